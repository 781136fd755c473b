/* Preloaded into a station: counts what it does to the disk below a folder, ends it at one of these operations as a
 * power failure would, and keeps what is needed to forget what was not synced. Driven by crash.py.
 *
 *   CRASH_FOLDER  only paths below it count         CRASH_AT    the operation at which the process is killed; 0: never
 *   CRASH_SHADOW  copies and the log of operations  CRASH_FULL  "FROM-TO": writes fail with ENOSPC from one operation to another
 *   CRASH_TORN    1: power is lost, so the last write may reach the disk in part; a kill lets it end
 *
 * The log has a line per operation that matters to what a loss of power may forget, its words apart by a tab:
 *   sync PATH COPY, folder PATH, create PATH, rename FROM TO COPY-OF-OLD, remove PATH COPY
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static const char *folder, *shadow;
static long count, crash_at, full_from, full_to, copies;
static int tears;
static int log_file = -1;

__attribute__((constructor)) static void begin(void) {
    folder = getenv("CRASH_FOLDER");
    shadow = getenv("CRASH_SHADOW");
    const char *at = getenv("CRASH_AT"), *full = getenv("CRASH_FULL");
    crash_at = at ? atol(at) : 0;
    tears = getenv("CRASH_TORN") != NULL;
    if (full) sscanf(full, "%ld-%ld", &full_from, &full_to);
    if (folder && shadow) {
        char path[4096];
        snprintf(path, sizeof path, "%s/log", shadow);
        log_file = syscall(SYS_openat, AT_FDCWD, path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
    }
}

static int below(const char *path) { return log_file >= 0 && path && strncmp(path, folder, strlen(folder)) == 0; }

static int of(int fd, char *path) {
    char link[64];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t length = syscall(SYS_readlink, link, path, 4095);
    if (length <= 0) return 0;
    path[length] = 0;
    return below(path);
}

static void note(const char *format, ...) {
    char line[12300];
    va_list args;
    va_start(args, format);
    int length = vsnprintf(line, sizeof line, format, args);
    va_end(args);
    syscall(SYS_write, log_file, line, length);
}

/* The name of a copy of a file as it is now, or "-" without one. */
static void copy(const char *path, char *name) {
    strcpy(name, "-");
    int from = syscall(SYS_openat, AT_FDCWD, path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0);
    struct stat stat;
    if (from < 0) return;
    if (fstat(from, &stat) == 0 && S_ISREG(stat.st_mode)) {
        snprintf(name, 32, "%d-%ld", getpid(), copies++);
        char place[4200], buffer[65536];
        snprintf(place, sizeof place, "%s/%s", shadow, name);
        int to = syscall(SYS_openat, AT_FDCWD, place, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
        for (ssize_t got; (got = syscall(SYS_read, from, buffer, sizeof buffer)) > 0;) syscall(SYS_write, to, buffer, got);
        syscall(SYS_close, to);
    }
    syscall(SYS_close, from);
}

/* One more operation; the process may end here. With the lock. */
static int step(void) {
    if (++count == crash_at) {
        note("end %ld\n", count);
        syscall(SYS_kill, getpid(), SIGKILL);
        for (;;) pause();
    }
    return full_from <= count && count < full_to;
}

#define NEXT(type, name) static type (*next)() = NULL; if (!next) next = (type (*)())dlsym(RTLD_NEXT, #name)

/* The last write before a crash reaches the disk up to the end of one of its blocks: a block is written whole. */
static ssize_t torn(int fd, const void *bytes, size_t size, off_t offset, int placed) {
    struct stat stat;
    if (!placed && fstat(fd, &stat) == 0) offset = fcntl(fd, F_GETFL) & O_APPEND ? stat.st_size : lseek(fd, 0, SEEK_CUR);
    size_t whole = (offset + size / 2) / 4096 * 4096;
    if (tears && count + 1 == crash_at && (off_t)whole > offset) syscall(SYS_pwrite64, fd, bytes, whole - offset, offset);
    return step() ? -1 : 0;
}

ssize_t write(int fd, const void *bytes, size_t size) {
    NEXT(ssize_t, write);
    char path[4096];
    if (fd <= 2 || !of(fd, path)) return next(fd, bytes, size);
    pthread_mutex_lock(&lock);
    ssize_t refused = torn(fd, bytes, size, 0, 0), done = refused ? -1 : syscall(SYS_write, fd, bytes, size);
    pthread_mutex_unlock(&lock);
    if (refused) errno = ENOSPC;
    return done;
}

#define PWRITE(name)                                                                                                       \
    ssize_t name(int fd, const void *bytes, size_t size, off_t offset) {                                                   \
        char path[4096];                                                                                                   \
        if (!of(fd, path)) return syscall(SYS_pwrite64, fd, bytes, size, offset);                                          \
        pthread_mutex_lock(&lock);                                                                                         \
        ssize_t refused = torn(fd, bytes, size, offset, 1), done = refused ? -1 : syscall(SYS_pwrite64, fd, bytes, size, offset); \
        pthread_mutex_unlock(&lock);                                                                                       \
        if (refused) errno = ENOSPC;                                                                                       \
        return done;                                                                                                       \
    }
PWRITE(pwrite)
PWRITE(pwrite64)

#define SYNC(name)                                                                                                         \
    int name(int fd) {                                                                                                     \
        NEXT(int, name);                                                                                                   \
        char path[4096], kept[32];                                                                                         \
        if (!of(fd, path)) return next(fd);                                                                                \
        pthread_mutex_lock(&lock);                                                                                         \
        step();                                                                                                            \
        struct stat stat;                                                                                                  \
        int done = next(fd);                                                                                               \
        if (done == 0 && fstat(fd, &stat) == 0) {                                                                          \
            if (S_ISDIR(stat.st_mode)) note("folder\t%s\n", path);                                                          \
            else { copy(path, kept); note("sync\t%s\t%s\n", path, kept); }                                                   \
        }                                                                                                                  \
        pthread_mutex_unlock(&lock);                                                                                       \
        return done;                                                                                                       \
    }
SYNC(fsync)
SYNC(fdatasync)

#define TRUNCATE(name)                                                                                                     \
    int name(int fd, off_t size) {                                                                                         \
        NEXT(int, name);                                                                                                   \
        char path[4096];                                                                                                   \
        if (of(fd, path)) { pthread_mutex_lock(&lock); step(); pthread_mutex_unlock(&lock); }                              \
        return next(fd, size);                                                                                             \
    }
TRUNCATE(ftruncate)
TRUNCATE(ftruncate64)

int rename(const char *from, const char *to) {
    NEXT(int, rename);
    if (!below(to)) return next(from, to);
    pthread_mutex_lock(&lock);
    step();
    char kept[32];
    copy(to, kept);
    int done = next(from, to);
    if (done == 0) note("rename\t%s\t%s\t%s\n", from, to, kept);
    pthread_mutex_unlock(&lock);
    return done;
}

static int removed(const char *path, int (*next)(const char *)) {
    if (!below(path)) return next(path);
    pthread_mutex_lock(&lock);
    step();
    char kept[32];
    copy(path, kept);
    int done = next(path);
    if (done == 0) note("remove\t%s\t%s\n", path, kept);
    pthread_mutex_unlock(&lock);
    return done;
}

int unlink(const char *path) {
    NEXT(int, unlink);
    return removed(path, (int (*)(const char *))next);
}

int remove(const char *path) {
    NEXT(int, remove);
    return removed(path, (int (*)(const char *))next);
}

static int opened(int at, const char *path, int flags, mode_t mode) {
    int new = (flags & O_CREAT) && below(path) && access(path, F_OK) != 0;
    if (new) { pthread_mutex_lock(&lock); step(); pthread_mutex_unlock(&lock); }
    int fd = syscall(SYS_openat, at, path, flags | O_LARGEFILE, mode);
    if (new && fd >= 0) note("create\t%s\n", path);
    return fd;
}

#define OPEN(name) int name(const char *path, int flags, ...) {                                                            \
    va_list args; va_start(args, flags); mode_t mode = va_arg(args, int); va_end(args);                                   \
    return opened(AT_FDCWD, path, flags, mode); }
#define OPENAT(name) int name(int at, const char *path, int flags, ...) {                                                  \
    va_list args; va_start(args, flags); mode_t mode = va_arg(args, int); va_end(args);                                   \
    return opened(at, path, flags, mode); }
OPEN(open)
OPEN(open64)
OPENAT(openat)
OPENAT(openat64)
