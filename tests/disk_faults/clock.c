/* Clocks that jump, for tests. Loaded before libc (LD_PRELOAD): the time of day goes years back and forth from call to call, as when somebody
 * sets it; the time since the start, which never runs back, makes a leap of half a second at every call, as after a machine was held. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdatomic.h>
#include <time.h>

static atomic_long calls;

int clock_gettime(clockid_t clock, struct timespec *now) {
    static int (*real)(clockid_t, struct timespec *);
    if (!real) real = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
    int result = real(clock, now);
    if (result != 0) return result;
    long call = atomic_fetch_add(&calls, 1);
    if (clock == CLOCK_REALTIME) {
        now->tv_sec += (call % 3 - 1) * 100000000L;
    } else if (clock == CLOCK_MONOTONIC) {
        now->tv_sec += call / 2;
    }
    return result;
}
