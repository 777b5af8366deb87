/* The core in a control loop: cc -O2 loop.c $(pkg-config --cflags --libs stylet) -o loop */
#include <stdio.h>
#include <stylet.h>

/* Static memory for the core and 4096 samples of a layer: no allocation. */
static _Alignas(64) unsigned char memory[4096 * 32 + 16384];

int main(void) {
    StyletCore *core;
    const char *why;
    StyletOutput out;
    if (stylet_init(memory, sizeof memory, NULL, &core, &why) != STYLET_OK) {
        fprintf(stderr, "%s\n", why);
        return 2;
    }
    for (int tick = 0; tick < 20000; tick++) {
        double t = tick * 1e-3, v = 2.3e-3, z = v * t - 0.005; /* from your encoder */
        double f = z > 0 ? 50.0 * z : 0.0;                     /* from your sensor */
        if (stylet_step(core, t, z, v, f, &out) != STYLET_OK) continue;
        if (tick % 2000 == 0) printf("%6.2f s  %6.2f N measured, %6.2f N enhanced, K %5.1f N/m\n", t, f, out.enhanced_n, out.stiffness_n_per_m);
    }
    return 0;
}
