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
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define NS 1000000000ll

static int (*real_gettime)(clockid_t, struct timespec *);
static int (*real_nanosleep)(clockid_t, int, const struct timespec *, struct timespec *);
static int64_t warp = 1, zero;

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
    }
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
    struct timespec t;
    set(&t, flags & TIMER_ABSTIME ? zero + (ns(want) - zero) / warp : ns(want) / warp);
    return real_nanosleep(clock, flags, &t, flags & TIMER_ABSTIME ? NULL : rest);
}
