/* Lets LinuxCNC's task read motion's status only between two servo cycles.
 *
 *     gcc -shared -fPIC -O2 -o taskshim.so taskshim.c -ldl
 *     LD_PRELOAD=".../clockshim.so .../taskshim.so" CLOCKSHIM_WARP=10 TASKSHIM_HOLD=FILE linuxcnc ...
 *
 * LinuxCNC up to 2.9 has a race of its own (github.com/LinuxCNC/linuxcnc issues 662, 3650; pull request 3971): task
 * writes a probing move and sees it taken, then reads motion's status. Between the command handler and the end of the
 * controller of the same servo cycle that status still says "done, nothing queued", or cannot be read at all and the one
 * of the cycle before stands. Task then reads the program's next line too early: "Queue is not empty after probing". In
 * real time one probing move in tens of thousands meets it; the faster the servo thread and the busier the computer, the
 * more.
 *
 * Task reads that status between NML::peek, with which it asks for the state of its input and output, and NML::write,
 * with which it tells its own. Where it has written a command (it then asks for the time more often than in a round
 * without), the servo thread stands still at the end of a cycle from the one to the other (clockshim.c). Nothing but the
 * moment is changed.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <sched.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

static volatile int *hold; /* shared with clockshim.c: [0] ticket with which the thread is to stand still, or 0; [1] with which it does */
static int asked;          /* for the time, since task read the status last */

__attribute__((constructor)) static void start(void) {
    const char *path = getenv("TASKSHIM_HOLD");
    int file = path && !strcmp(program_invocation_short_name, "milltask") ? open(path, O_RDWR) : -1;
    if (file < 0) return;
    void *page = mmap(NULL, 2 * sizeof *hold, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    close(file);
    if (page != MAP_FAILED) hold = page;
    const struct sched_param before_others = {1}; /* behind the servo thread */
    sched_setscheduler(0, SCHED_RR, &before_others);
}

/* The function that stands behind ours: in a program that has loaded its library by hand it is in no chain. */
static void *behind(const char *name) {
    void *found = dlsym(RTLD_NEXT, name);
    if (!found) found = dlsym(dlopen("libnml.so.0", RTLD_LAZY | RTLD_NOLOAD), name);
    if (!found) abort();
    return found;
}

static int64_t milliseconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1000ll + t.tv_nsec / 1000000;
}

double etime(void) {
    static double (*real)(void);
    if (!real) real = behind("etime");
    asked++;
    return real();
}

int _ZN3NML4peekEv(void *channel) {
    static int (*real)(void *);
    static int ticket, least = INT_MAX;
    if (!real) real = behind("_ZN3NML4peekEv");
    int answer = real(channel);
    if (asked < least) least = asked;
    int commanded = asked > least;
    asked = 0;
    if (hold && commanded) {
        ticket = ticket % 1000000 + 1;
        *hold = ticket;
        __sync_synchronize();
        /* before the thread runs and after its end nobody stands still */
        for (int64_t end = milliseconds() + 100; hold[1] != ticket && milliseconds() < end;) sched_yield();
    }
    return answer;
}

static void let_go(void) {
    __sync_synchronize();
    if (hold) *hold = 0;
}

int _ZN3NML5writeER6NMLmsgPi(void *channel, void *message, int *serial) {
    static int (*real)(void *, void *, int *);
    if (!real) real = behind("_ZN3NML5writeER6NMLmsgPi");
    let_go();
    return real(channel, message, serial);
}

int _ZN3NML5writeEP6NMLmsgPi(void *channel, void *message, int *serial) {
    static int (*real)(void *, void *, int *);
    if (!real) real = behind("_ZN3NML5writeEP6NMLmsgPi");
    let_go();
    return real(channel, message, serial);
}
