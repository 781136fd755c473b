/* The bare loop that our bus is measured against: libmodbus reads 10 registers again and again and does nothing else.
   rtu PATH BAUD SECONDS | tcp HOST PORT SECONDS; prints transactions, seconds, CPU seconds. */
#include <errno.h>
#include <modbus.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec + t.tv_nsec * 1e-9;
}

int main(int argc, char **argv) {
    if (argc != 5) return 2;
    int rtu = !strcmp(argv[1], "rtu");
    modbus_t *line = rtu ? modbus_new_rtu(argv[2], atoi(argv[3]), 'N', 8, 1) : modbus_new_tcp(argv[2], atoi(argv[3]));
    /* 3.5 characters between an answer and the next request, which libmodbus leaves to the caller. */
    double silence = !rtu ? 0 : atoi(argv[3]) > 19200 ? 1.75e-3 : 35.0 / atoi(argv[3]);
    if (!line || modbus_set_slave(line, 1) || modbus_connect(line)) {
        fprintf(stderr, "%s: %s\n", argv[2], modbus_strerror(errno));
        return 1;
    }
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
        if (silence > 0) {
            struct timespec pause = {0, (long) (silence * 1e9)};
            nanosleep(&pause, NULL);
        }
    }
    seconds = now() - start;
    struct rusage used;
    getrusage(RUSAGE_SELF, &used);
    printf("%ld %f %f\n", done, seconds,
           used.ru_utime.tv_sec + used.ru_stime.tv_sec + (used.ru_utime.tv_usec + used.ru_stime.tv_usec) * 1e-6);
    return 0;
}
