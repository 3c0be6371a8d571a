/* Makes the servo thread of LinuxCNC (uspace) run K times faster than real time.
 *
 *     gcc -shared -fPIC -O2 -o clockshim.so clockshim.c -ldl
 *     LD_PRELOAD=.../clockshim.so CLOCKSHIM_WARP=10 linuxcnc ...
 *
 * The realtime loop of rtapi_app sleeps until an absolute CLOCK_MONOTONIC time with clock_nanosleep and
 * reads that clock with clock_gettime. Both are scaled here about the moment at which the library was
 * loaded. Nothing else is: relative sleeps, other clocks and every other process keep real time, for the
 * preload reaches all children of the `linuxcnc` script but acts in rtapi_app only.
 *
 * rtapi_app is setuid root. The loader ignores LD_PRELOAD for a setuid program, except when root itself
 * starts it: warping works as root only.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <sched.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#define NS 1000000000ll

static int (*real_gettime)(clockid_t, struct timespec *);
static int (*real_nanosleep)(clockid_t, int, const struct timespec *, struct timespec *);
static int64_t warp = 1, zero;
static volatile int *hold; /* shared with taskshim.c: [0] ticket with which this thread is to stand still, or 0; [1] with which it does */

static int64_t ns(const struct timespec *t) { return t->tv_sec * NS + t->tv_nsec; }
static void set(struct timespec *t, int64_t n) { t->tv_sec = n / NS; t->tv_nsec = n % NS; }

__attribute__((constructor)) static void start(void) {
    const char *k = getenv("CLOCKSHIM_WARP");
    struct timespec now;
    real_gettime = dlsym(RTLD_NEXT, "clock_gettime");
    real_nanosleep = dlsym(RTLD_NEXT, "clock_nanosleep");
    if (k && atoi(k) > 1 && !strcmp(program_invocation_short_name, "rtapi_app")) {
        real_gettime(CLOCK_MONOTONIC, &now);
        zero = ns(&now);
        warp = atoi(k);
        const struct rlimit any = {99, 99};
        setrlimit(RLIMIT_RTPRIO, &any); /* while this is root's process */
        const char *path = getenv("TASKSHIM_HOLD");
        int file = path ? open(path, O_RDWR) : -1;
        if (file >= 0) {
            void *page = mmap(NULL, 2 * sizeof *hold, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
            close(file);
            if (page != MAP_FAILED) hold = page;
        }
    }
}

/* At the end of a cycle: stands still while task reads what motion wrote, for half a second at most (should task be gone). */
static void stand_still(void) {
    struct timespec t;
    int ticket = hold ? *hold : 0;
    if (!ticket) return;
    real_gettime(CLOCK_MONOTONIC, &t);
    int64_t end = ns(&t) + NS / 2;
    __sync_synchronize();
    hold[1] = ticket;
    /* a realtime thread that only yields keeps task from its processor */
    const struct timespec moment = {0, 10000};
    while (*hold == ticket && ns(&t) < end) {
        real_nanosleep(CLOCK_MONOTONIC, 0, &moment, NULL);
        real_gettime(CLOCK_MONOTONIC, &t);
    }
    __sync_synchronize();
}

int clock_gettime(clockid_t clock, struct timespec *t) {
    if (!real_gettime) real_gettime = dlsym(RTLD_NEXT, "clock_gettime"); /* called before our constructor */
    int r = real_gettime(clock, t);
    if (!r && warp > 1 && clock == CLOCK_MONOTONIC) set(t, zero + (ns(t) - zero) * warp);
    return r;
}

int clock_nanosleep(clockid_t clock, int flags, const struct timespec *want, struct timespec *rest) {
    if (!real_nanosleep) real_nanosleep = dlsym(RTLD_NEXT, "clock_nanosleep");
    if (warp == 1 || clock != CLOCK_MONOTONIC) return real_nanosleep(clock, flags, want, rest);
    static __thread int first;
    if (flags & TIMER_ABSTIME && !first++) { /* the servo thread: whatever else the computer does, it runs when its time has come */
        const struct sched_param before_others = {2};
        if (sched_setscheduler(0, SCHED_FIFO, &before_others)) fprintf(stderr, "clockshim: no realtime scheduling: %s\n", strerror(errno));
    }
    struct timespec t;
    set(&t, flags & TIMER_ABSTIME ? zero + (ns(want) - zero) / warp : ns(want) / warp);
    if (flags & TIMER_ABSTIME) stand_still();
    int r = real_nanosleep(clock, flags, &t, flags & TIMER_ABSTIME ? NULL : rest);
    if (flags & TIMER_ABSTIME) stand_still();
    return r;
}
