/* Faults of a disk, for tests. Loaded before libc (LD_PRELOAD) it counts the calls that change anything at or below the folder
 * STYLET_FAULT_BELOW and lets one of them fail.
 *
 * Before the first such call the process stops and becomes a server: for every line "MODE N" on standard input it forks, the child goes on
 * with the command and meets its fault at call N, and the parent writes one line: wait status, calls that were counted, what was hit.
 * So a command computes once, however many faults its writing has to stand. The child's standard error goes to STYLET_FAULT_STDERR.
 *
 * Modes: k killed before the call, a killed after it, t terminated before it, e it fails with EIO, n with ENOSPC,
 * E it and all later ones fail with EIO, N with ENOSPC, s a write is cut short and there is no room from then on, - nothing.
 * ENOSPC meets only calls that need room. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/sendfile.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <sys/wait.h>
#include <unistd.h>

#define REAL(name) \
    static __typeof__(&name) real; \
    if (!real) real = (__typeof__(&name))dlsym(RTLD_NEXT, #name)

enum { SECONDS = 120 };

struct report {
    atomic_long calls;
    char hit[512];
};

static struct report *report;
static char mode = '-';
static long at;
static int served;
static int full;

static void copy(char *to, size_t room, const char *from) { snprintf(to, room, "%s", from); }

static void of_fd(char *to, size_t room, int fd) {
    char link[64];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t n = readlink(link, to, room - 1);
    to[n > 0 ? n : 0] = 0;
}

static void of_path(char *to, size_t room, int dir, const char *path) {
    char base[PATH_MAX];
    if (!path || path[0] == '/') {
        copy(to, room, path ? path : "");
        return;
    }
    if (dir == AT_FDCWD) {
        if (!getcwd(base, sizeof base)) base[0] = 0;
    } else {
        of_fd(base, sizeof base, dir);
    }
    snprintf(to, room, "%s/%s", base, path);
}

static int below(const char *path) {
    const char *folder = getenv("STYLET_FAULT_BELOW");
    size_t n = folder ? strlen(folder) : 0;
    return n && !strncmp(path, folder, n) && (path[n] == 0 || path[n] == '/');
}

/* Returns in every child; never in the parent. */
static void serve(void) {
    char line[64];
    served = 1;
    report = mmap(0, sizeof *report, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (report == MAP_FAILED) _exit(99);
    for (;;) {
        size_t n = 0;
        char c;
        while (read(0, &c, 1) == 1 && c != '\n')
            if (n < sizeof line - 1) line[n++] = c;
        line[n] = 0;
        if (sscanf(line, "%c %ld", &mode, &at) != 2) _exit(0);
        atomic_store(&report->calls, 0);
        report->hit[0] = 0;
        pid_t child = fork();
        if (child < 0) _exit(99);
        if (child == 0) {
            REAL(open);
            int errors = real(getenv("STYLET_FAULT_STDERR"), O_WRONLY | O_CREAT | O_TRUNC, 0600);
            int nothing = real("/dev/null", O_RDWR);
            dup2(nothing, 0);
            dup2(nothing, 1);
            dup2(errors, 2);
            close(errors);
            close(nothing);
            alarm(SECONDS);
            return;
        }
        int status = 0;
        waitpid(child, &status, 0);
        char out[700];
        int m = snprintf(out, sizeof out, "%d %ld %s\n", status, atomic_load(&report->calls), report->hit);
        REAL(write);
        if (real(1, out, (size_t)m) != m) _exit(99);
    }
}

enum { NOTHING = 0, FAIL = -1, AFTER = 1, SHORT = 2 };

/* What happens to a call. `room`: whether it needs room on the disk; `bytes`: of a write. */
static int strike(const char *what, const char *path, int room, size_t bytes) {
    if (!below(path)) return NOTHING;
    if (!served) serve();
    long call = atomic_fetch_add(&report->calls, 1) + 1;
    if (full && room) {
        errno = ENOSPC;
        return FAIL;
    }
    int lasting = mode == 'E' || mode == 'N';
    if (mode == '-' || !(call == at || (lasting && call > at))) return NOTHING;
    if (strchr("nNs", mode) && !room) return NOTHING;
    if (!report->hit[0]) snprintf(report->hit, sizeof report->hit, "%s %s", what, path);
    switch (mode) {
    case 'k': kill(getpid(), SIGKILL); pause(); break;
    case 't': kill(getpid(), SIGTERM); pause(); break;
    case 'a': return AFTER;
    case 'e':
    case 'E': errno = EIO; return FAIL;
    case 's':
        full = 1;
        if (bytes > 1) return SHORT;
        /* fall through */
    default: errno = ENOSPC; return FAIL;
    }
    return NOTHING;
}

static int past(int struck) {
    if (struck == AFTER) {
        kill(getpid(), SIGKILL);
        pause();
    }
    return 1;
}

#define CALL(type, what, path, room, bytes, call) \
    int struck = strike(what, path, room, bytes); \
    if (struck == FAIL) return -1; \
    type result = call; \
    past(struck); \
    return result

#define CHANGES(flags) (((flags) & O_ACCMODE) != O_RDONLY || ((flags) & (O_CREAT | O_TRUNC)))

#define OPEN(name) \
    int name(const char *path, int flags, ...) { \
        va_list more; \
        va_start(more, flags); \
        mode_t m = va_arg(more, mode_t); \
        va_end(more); \
        REAL(name); \
        if (!CHANGES(flags)) return real(path, flags, m); \
        char full_path[PATH_MAX]; \
        of_path(full_path, sizeof full_path, AT_FDCWD, path); \
        CALL(int, #name, full_path, 1, 0, real(path, flags, m)); \
    }

#define OPENAT(name) \
    int name(int dir, const char *path, int flags, ...) { \
        va_list more; \
        va_start(more, flags); \
        mode_t m = va_arg(more, mode_t); \
        va_end(more); \
        REAL(name); \
        if (!CHANGES(flags)) return real(dir, path, flags, m); \
        char full_path[PATH_MAX]; \
        of_path(full_path, sizeof full_path, dir, path); \
        CALL(int, #name, full_path, 1, 0, real(dir, path, flags, m)); \
    }

OPEN(open)
OPEN(open64)
OPENAT(openat)
OPENAT(openat64)

#define ON_PATH(name, room, parameters, dir, path, ...) \
    int name parameters { \
        REAL(name); \
        char full_path[PATH_MAX]; \
        of_path(full_path, sizeof full_path, dir, path); \
        CALL(int, #name, full_path, room, 0, real(__VA_ARGS__)); \
    }

ON_PATH(creat, 1, (const char *path, mode_t m), AT_FDCWD, path, path, m)
ON_PATH(creat64, 1, (const char *path, mode_t m), AT_FDCWD, path, path, m)
ON_PATH(mkdir, 1, (const char *path, mode_t m), AT_FDCWD, path, path, m)
ON_PATH(mkdirat, 1, (int dir, const char *path, mode_t m), dir, path, dir, path, m)
ON_PATH(unlink, 0, (const char *path), AT_FDCWD, path, path)
ON_PATH(rmdir, 0, (const char *path), AT_FDCWD, path, path)
ON_PATH(unlinkat, 0, (int dir, const char *path, int flags), dir, path, dir, path, flags)
ON_PATH(rename, 0, (const char *from, const char *to), AT_FDCWD, to, from, to)
ON_PATH(renameat, 0, (int a, const char *from, int b, const char *to), b, to, a, from, b, to)
ON_PATH(renameat2, 0, (int a, const char *from, int b, const char *to, unsigned f), b, to, a, from, b, to, f)
ON_PATH(link, 1, (const char *from, const char *to), AT_FDCWD, to, from, to)
ON_PATH(symlink, 1, (const char *from, const char *to), AT_FDCWD, to, from, to)

#define ON_FD(type, name, room, bytes, parameters, fd, ...) \
    type name parameters { \
        REAL(name); \
        char path[PATH_MAX]; \
        of_fd(path, sizeof path, fd); \
        CALL(type, #name, path, room, bytes, real(__VA_ARGS__)); \
    }

ON_FD(int, fsync, 1, 0, (int fd), fd, fd)
ON_FD(int, fdatasync, 1, 0, (int fd), fd, fd)
ON_FD(int, ftruncate, 1, 0, (int fd, off_t n), fd, fd, n)
ON_FD(int, ftruncate64, 1, 0, (int fd, off64_t n), fd, fd, n)
ON_FD(ssize_t, writev, 1, 0, (int fd, const struct iovec *v, int n), fd, fd, v, n)
ON_FD(ssize_t, pwrite64, 1, 0, (int fd, const void *b, size_t n, off64_t o), fd, fd, b, n, o)
ON_FD(ssize_t, copy_file_range, 1, 0, (int a, off64_t *p, int fd, off64_t *q, size_t n, unsigned f), fd, a, p, fd, q, n, f)
ON_FD(ssize_t, sendfile64, 1, 0, (int fd, int a, off64_t *o, size_t n), fd, fd, a, o, n)
ON_FD(ssize_t, splice, 1, 0, (int a, off64_t *p, int fd, off64_t *q, size_t n, unsigned f), fd, a, p, fd, q, n, f)

ssize_t write(int fd, const void *bytes, size_t n) {
    REAL(write);
    char path[PATH_MAX];
    of_fd(path, sizeof path, fd);
    int struck = strike("write", path, 1, n);
    if (struck == FAIL) return -1;
    ssize_t result = real(fd, bytes, struck == SHORT ? n / 2 : n);
    past(struck);
    return result;
}
