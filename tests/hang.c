/* A file system of which every operation waits while a file exists, as that of a lost server does. Driven by hang.py.
 *
 *   hang FOLDER FILE MOUNT   shows FOLDER at MOUNT; waits while FILE exists; who waits can be killed
 */
#define FUSE_USE_VERSION 31
#define _GNU_SOURCE
#include <fuse.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <fcntl.h>
#include <dirent.h>
#include <errno.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <sys/file.h>
static char root[2048], hang[2048];
static int gate(void) { while (access(hang, F_OK) == 0) { if (fuse_interrupted()) return -EINTR; usleep(20000); } return 0; }
#define G if (gate()) return -EINTR
#define P(path) char p[4096]; G; snprintf(p, sizeof p, "%s%s", root, path)
#define R(x) do { long r_ = (x); return r_ < 0 ? -errno : (int)r_; } while (0)
#define Z(x) do { return (x) < 0 ? -errno : 0; } while (0)
static int f_getattr(const char *a, struct stat *s, struct fuse_file_info *f) { if (f) { G; Z(fstat(f->fh, s)); } P(a); Z(lstat(p, s)); }
static int f_access(const char *a, int m) { P(a); Z(access(p, m)); }
static int f_readlink(const char *a, char *b, size_t n) { P(a); int r = readlink(p, b, n - 1); if (r < 0) return -errno; b[r] = 0; return 0; }
static int f_readdir(const char *a, void *b, fuse_fill_dir_t fill, off_t o, struct fuse_file_info *f, enum fuse_readdir_flags g) {
    P(a); DIR *d = opendir(p); if (!d) return -errno; struct dirent *e;
    while ((e = readdir(d))) fill(b, e->d_name, NULL, 0, 0);
    closedir(d); return 0; }
static int f_mkdir(const char *a, mode_t m) { P(a); Z(mkdir(p, m)); }
static int f_unlink(const char *a) { P(a); Z(unlink(p)); }
static int f_rmdir(const char *a) { P(a); Z(rmdir(p)); }
static int f_symlink(const char *a, const char *b) { P(b); Z(symlink(a, p)); }
static int f_rename(const char *a, const char *b, unsigned fl) { P(a); char q[4096]; snprintf(q, sizeof q, "%s%s", root, b); Z(renameat2(AT_FDCWD, p, AT_FDCWD, q, fl)); }
static int f_link(const char *a, const char *b) { P(a); char q[4096]; snprintf(q, sizeof q, "%s%s", root, b); Z(link(p, q)); }
static int f_chmod(const char *a, mode_t m, struct fuse_file_info *f) { P(a); Z(chmod(p, m)); }
static int f_chown(const char *a, uid_t u, gid_t g, struct fuse_file_info *f) { P(a); Z(lchown(p, u, g)); }
static int f_truncate(const char *a, off_t n, struct fuse_file_info *f) { if (f) { G; Z(ftruncate(f->fh, n)); } P(a); Z(truncate(p, n)); }
static int f_utimens(const char *a, const struct timespec t[2], struct fuse_file_info *f) { P(a); Z(utimensat(AT_FDCWD, p, t, AT_SYMLINK_NOFOLLOW)); }
static int f_open(const char *a, struct fuse_file_info *f) { P(a); int r = open(p, f->flags & ~O_NOFOLLOW); if (r < 0) return -errno; f->fh = r; return 0; }
static int f_create(const char *a, mode_t m, struct fuse_file_info *f) { P(a); int r = open(p, f->flags, m); if (r < 0) return -errno; f->fh = r; return 0; }
static int f_read(const char *a, char *b, size_t n, off_t o, struct fuse_file_info *f) { G; R(pread(f->fh, b, n, o)); }
static int f_write(const char *a, const char *b, size_t n, off_t o, struct fuse_file_info *f) { G; R(pwrite(f->fh, b, n, o)); }
static int f_statfs(const char *a, struct statvfs *s) { P(a); Z(statvfs(p, s)); }
static int f_flush(const char *a, struct fuse_file_info *f) { Z(close(dup(f->fh))); }
static int f_release(const char *a, struct fuse_file_info *f) { close(f->fh); return 0; }
static int f_fsync(const char *a, int d, struct fuse_file_info *f) { G; Z(d ? fdatasync(f->fh) : fsync(f->fh)); }
static int f_fsyncdir(const char *a, int d, struct fuse_file_info *f) { G; return 0; }
static int f_flock(const char *a, struct fuse_file_info *f, int op) { if (!(op & LOCK_UN)) G; Z(flock(f->fh, op)); }
static int f_lock(const char *a, struct fuse_file_info *f, int cmd, struct flock *l) { if (l->l_type != F_UNLCK) G; if (cmd == F_SETLKW) cmd = F_OFD_SETLK; else if (cmd == F_SETLK) cmd = F_OFD_SETLK; else cmd = F_OFD_GETLK; l->l_pid = 0; Z(fcntl(f->fh, cmd, l)); }
static int f_fallocate(const char *a, int m, off_t o, off_t n, struct fuse_file_info *f) { G; Z(fallocate(f->fh, m, o, n)); }
static void *f_init(struct fuse_conn_info *c, struct fuse_config *cfg) { cfg->use_ino = 1; cfg->intr = 1; cfg->intr_signal = 10; cfg->nullpath_ok = 0; cfg->entry_timeout = cfg->attr_timeout = cfg->negative_timeout = 0; return NULL; }
static struct fuse_operations ops = { .init = f_init, .getattr = f_getattr, .access = f_access, .readlink = f_readlink, .readdir = f_readdir, .mkdir = f_mkdir, .unlink = f_unlink, .rmdir = f_rmdir, .symlink = f_symlink, .rename = f_rename, .link = f_link, .chmod = f_chmod, .chown = f_chown, .truncate = f_truncate, .utimens = f_utimens, .open = f_open, .create = f_create, .read = f_read, .write = f_write, .statfs = f_statfs, .flush = f_flush, .release = f_release, .fsync = f_fsync, .fsyncdir = f_fsyncdir, .flock = f_flock, .lock = f_lock, .fallocate = f_fallocate };
#include <signal.h>
static void nothing(int s) {}
int main(int n, char **v) { struct sigaction a = { .sa_handler = nothing }; sigaction(10, &a, NULL); realpath(v[1], root); snprintf(hang, sizeof hang, "%s", v[2]); v[2] = v[0]; return fuse_main(n - 2, v + 2, &ops, NULL); }
