/* What our bus is measured against: libmodbus reads 10 registers again and again and does nothing else.
   rtu PATH BAUD SECONDS | tcp HOST PORT SECONDS: one unit as fast as it can; prints transactions, seconds, CPU seconds.
   poll PATH BAUD SECONDS TIMEOUT_MS UNIT:PERIOD_US...: each unit in its period; a read that fails is not repeated. */
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

static void pause_for(double seconds) {
    struct timespec pause = {(time_t) seconds, (long) ((seconds - (time_t) seconds) * 1e9)};
    if (seconds > 0) nanosleep(&pause, NULL);
}

static int poll_units(modbus_t *line, double silence, double seconds, int timeout_ms, int count, char **units) {
    int unit[64];
    double period[64], due[64], start = now(), end = start + seconds;
    if (count > 64) return 2;
    for (int i = 0; i < count; i++) {
        long us;
        if (sscanf(units[i], "%d:%ld", &unit[i], &us) != 2) return 2;
        period[i] = us * 1e-6;
        due[i] = start;
    }
    modbus_set_response_timeout(line, timeout_ms / 1000, timeout_ms % 1000 * 1000);
    while (now() < end) {
        double next = end;
        for (int i = 0; i < count; i++) {
            double t = now();
            if (t < due[i]) {
                if (due[i] < next) next = due[i];
                continue;
            }
            uint16_t words[10];
            modbus_set_slave(line, unit[i]);
            if (modbus_read_registers(line, 0, 10, words) != 10) modbus_flush(line);
            pause_for(silence);
            /* What is over by now is left out. */
            while (due[i] <= t) due[i] += period[i];
            if (due[i] < next) next = due[i];
        }
        pause_for(next - now());
    }
    return 0;
}

int main(int argc, char **argv) {
    if (argc < 5) return 2;
    int tcp = !strcmp(argv[1], "tcp");
    modbus_t *line = tcp ? modbus_new_tcp(argv[2], atoi(argv[3])) : modbus_new_rtu(argv[2], atoi(argv[3]), 'N', 8, 1);
    /* 3.5 characters between an answer and the next request, which libmodbus leaves to the caller. */
    double silence = tcp ? 0 : atoi(argv[3]) > 19200 ? 1.75e-3 : 35.0 / atoi(argv[3]);
    if (!line || modbus_set_slave(line, 1) || modbus_connect(line)) {
        fprintf(stderr, "%s: %s\n", argv[2], modbus_strerror(errno));
        return 1;
    }
    if (!strcmp(argv[1], "poll"))
        return argc < 7 ? 2 : poll_units(line, silence, atof(argv[4]), atoi(argv[5]), argc - 6, argv + 6);
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
