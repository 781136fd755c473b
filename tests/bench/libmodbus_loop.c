/* What our bus is measured against: libmodbus reads 10 registers again and again and does nothing else.
   rtu PATH BAUD SECONDS | tcp HOST PORT SECONDS: one unit as fast as it can; prints transactions, seconds, CPU seconds.
   poll PATH BAUD SECONDS TIMEOUT_MS UNIT:PERIOD_US[:ADDRESS:COUNT]...: each block in its period; a read that fails is not
   repeated; prints of each that is right the time, unit, address and first four registers.
   poll-tcp | poll-rtu-over-tcp HOST PORT SECONDS TIMEOUT_MS ...: the same.
   serve: a slave for one TCP master, as fast as it can; prints its port, and twice a second how many reads it has served. */
#include <arpa/inet.h>
#include <errno.h>
#include <modbus.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec + t.tv_nsec * 1e-9;
}

static void pause_for(double seconds) {
    struct timespec pause = {(time_t) seconds, (long) ((seconds - (time_t) seconds) * 1e9)};
    if (seconds > 0) nanosleep(&pause, NULL);
}

/* Discards what came late. */
static void drain(int fd) {
    char bytes[512];
    struct pollfd in = {fd, POLLIN, 0};
    while (poll(&in, 1, 0) > 0 && read(fd, bytes, sizeof bytes) > 0) {}
}

static int poll_blocks(modbus_t *line, double silence, double seconds, int timeout_ms, int blocks, char **block) {
    int unit[64], address[64], count[64];
    double period[64], due[64], start = now(), end = start + seconds;
    if (blocks > 64) return 2;
    for (int i = 0; i < blocks; i++) {
        long us;
        address[i] = 0, count[i] = 10;
        if (sscanf(block[i], "%d:%ld:%d:%d", &unit[i], &us, &address[i], &count[i]) < 2 || count[i] > 125) return 2;
        period[i] = us * 1e-6;
        due[i] = start;
    }
    modbus_set_response_timeout(line, timeout_ms / 1000, timeout_ms % 1000 * 1000);
    while (now() < end) {
        double next = end;
        for (int i = 0; i < blocks; i++) {
            double t = now();
            if (t < due[i]) {
                if (due[i] < next) next = due[i];
                continue;
            }
            uint16_t w[125] = {0};
            modbus_set_slave(line, unit[i]);
            drain(modbus_get_socket(line));
            if (modbus_read_registers(line, address[i], count[i], w) == count[i]) {
                struct timespec at;
                clock_gettime(CLOCK_REALTIME, &at);
                printf("%ld.%06ld %d %d ", at.tv_sec, at.tv_nsec / 1000, unit[i], address[i]);
                printf("%04x%04x%04x%04x\n", w[0], w[1], w[2], w[3]);
            }
            pause_for(silence);
            /* What is over by now is left out. */
            while (due[i] <= t) due[i] += period[i];
            if (due[i] < next) next = due[i];
        }
        pause_for(next - now());
    }
    return 0;
}

static int tcp_socket(const char *host, int port) {
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons(port)};
    int fd = socket(AF_INET, SOCK_STREAM, 0);
    if (inet_pton(AF_INET, host, &to.sin_addr) != 1 || connect(fd, (struct sockaddr *) &to, sizeof to)) return -1;
    return fd;
}

/* Register N holds N. Requests that came together are answered together. */
static int serve(void) {
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof at;
    int listener = socket(AF_INET, SOCK_STREAM, 0);
    if (bind(listener, (struct sockaddr *) &at, size) || listen(listener, 1)) return 1;
    getsockname(listener, (struct sockaddr *) &at, &size);
    printf("%d\n", ntohs(at.sin_port));
    fflush(stdout);
    int fd = accept(listener, NULL, NULL);
    uint8_t in[4096], out[sizeof in / 12 * 259];
    long served = 0;
    double reported = now();
    for (ssize_t have = 0, got; (got = read(fd, in + have, sizeof in - have)) > 0;) {
        size_t used = 0, length = 0;
        have += got;
        for (; have - used >= 12; used += 12, served++) {
            uint8_t *from = in + used, *to = out + length;
            int address = from[8] << 8 | from[9], bytes = 2 * from[11];
            if (from[7] != 3 || bytes > 250) return 3;
            memcpy(to, from, 8);
            to[4] = 0, to[5] = 3 + bytes, to[8] = bytes;
            for (int i = 0; i < bytes / 2; i++) to[9 + 2 * i] = (address + i) >> 8, to[10 + 2 * i] = address + i;
            length += 9 + bytes;
        }
        memmove(in, in + used, have -= used);
        for (size_t sent = 0; sent < length;) {
            ssize_t some = write(fd, out + sent, length - sent);
            if (some <= 0) return 0;
            sent += some;
        }
        if (now() - reported > 0.5) {
            reported = now();
            printf("%f %ld\n", reported, served);
            fflush(stdout);
        }
    }
    return 0;
}

int main(int argc, char **argv) {
    if (argc == 2 && !strcmp(argv[1], "serve")) return serve();
    if (argc < 5) return 2;
    const char *mode = argv[1];
    int polls = !strncmp(mode, "poll", 4), tcp = !strcmp(mode, "tcp") || !strcmp(mode, "poll-tcp");
    int tunnel = !strcmp(mode, "poll-rtu-over-tcp"), fd = -1;
    modbus_t *line = tcp ? modbus_new_tcp(argv[2], atoi(argv[3]))
                         : modbus_new_rtu(argv[2], tunnel ? 9600 : atoi(argv[3]), 'N', 8, 1);
    /* 3.5 characters between an answer and the next request, which libmodbus leaves to the caller. */
    double silence = tcp || tunnel ? 0 : atoi(argv[3]) > 19200 ? 1.75e-3 : 35.0 / atoi(argv[3]);
    /* libmodbus has no RTU over TCP, but takes a socket for its port. */
    if (tunnel && (fd = tcp_socket(argv[2], atoi(argv[3]))) >= 0) modbus_set_socket(line, fd);
    if (!line || modbus_set_slave(line, 1) || (tunnel ? fd < 0 : modbus_connect(line))) {
        fprintf(stderr, "%s: %s\n", argv[2], modbus_strerror(errno));
        return 1;
    }
    if (polls) return argc < 7 ? 2 : poll_blocks(line, silence, atof(argv[4]), atoi(argv[5]), argc - 6, argv + 6);
    long done = 0;
    double start = now(), end = start + atof(argv[4]), seconds;
    while (now() < end) {
        uint16_t words[10];
        int address = 20 * (done % 10);
        if (modbus_read_registers(line, address, 10, words) != 10 || words[9] != address + 9) {
            fprintf(stderr, "wrong answer: %s\n", modbus_strerror(errno));
            return 1;
        }
        done++;
        pause_for(silence);
    }
    seconds = now() - start;
    struct rusage used;
    getrusage(RUSAGE_SELF, &used);
    printf("%ld %f %f\n", done, seconds,
           used.ru_utime.tv_sec + used.ru_stime.tv_sec + (used.ru_utime.tv_usec + used.ru_stime.tv_usec) * 1e-6);
    return 0;
}
