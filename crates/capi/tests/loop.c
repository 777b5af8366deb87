/* A control loop in C: replays binary samples from standard input (four doubles each) and writes outputs, or, with an argument N,
 * times N steps of its own; counts allocations. */
#define _GNU_SOURCE
#include "stylet.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static unsigned long allocations;
extern void *__libc_malloc(size_t);
extern void *__libc_calloc(size_t, size_t);
extern void *__libc_realloc(void *, size_t);
void *malloc(size_t n) { allocations++; return __libc_malloc(n); }
void *calloc(size_t n, size_t m) { allocations++; return __libc_calloc(n, m); }
void *realloc(void *p, size_t n) { allocations++; return __libc_realloc(p, n); }

static StyletCore *start(size_t samples) {
    size_t bytes = stylet_size(samples);
    void *memory = aligned_alloc(stylet_align(), (bytes + 63) / 64 * 64);
    StyletConfig config;
    StyletCore *core = NULL;
    const char *why = "";
    if (!memory || stylet_default_config(&config) != STYLET_OK) exit(2);
    if (stylet_init(memory, bytes, &config, &core, &why) != STYLET_OK) {
        fprintf(stderr, "%s\n", why);
        exit(2);
    }
    return core;
}

static int by_size(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double now_ns(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1e9 + t.tv_nsec;
}

int main(int argc, char **argv) {
    StyletOutput out;
    if (argc < 2) {
        double s[4];
        StyletCore *core = start(16384);
        while (fread(s, sizeof s, 1, stdin) == 1) {
            stylet_step(core, s[0], s[1], s[2], s[3], &out);
            fwrite(&out.enhanced_n, 8, 1, stdout);
            fwrite(&out.stiffness_n_per_m, 8, 1, stdout);
            double state = out.state;
            fwrite(&state, 8, 1, stdout);
        }
        return 0;
    }
    /* 1 kHz, repeated insertion at 2.3 mm/s through three layers of 20 mm. */
    size_t steps = strtoull(argv[1], NULL, 10);
    StyletCore *core = start(4096);
    double *took = calloc(steps, sizeof *took);
    double sum = 0.0;
    if (!took) return 2;
    unsigned long before = allocations;
    for (size_t k = 0; k < steps; k++) {
        double t = k * 1e-3, v = 2.3e-3, z = fmod(v * t, 0.065) - 0.002, x = fmod(z, 0.02);
        double f = z > 0 ? 50.0 * x + 9000.0 * z * v : 0.0;
        f += 0.01 * sin(12345.678 * k);
        double from = now_ns();
        stylet_step(core, t, z, v, f, &out);
        took[k] = now_ns() - from;
        sum += out.enhanced_n;
    }
    unsigned long during = allocations - before;
    qsort(took, steps, sizeof *took, by_size);
    printf("steps %zu allocations %lu p50_ns %.0f p999_ns %.0f worst_ns %.0f mean_enhanced_n %.6f ruptures %u\n", steps, during,
           took[steps / 2], took[(size_t)(0.999 * steps)], took[steps - 1], sum / steps, out.ruptures);
    return during != 0;
}
