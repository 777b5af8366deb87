/* Reads a recording.csv from standard input and writes the enhanced force of each sample as 64-bit floats. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <stylet.h>

/* Column of a name in the header line, from 0; -1 when there is none. */
static int column_of(const char *header, const char *name) {
    int column = 0;
    for (const char *at = header; *at; column++) {
        size_t length = strcspn(at, ",\r\n");
        if (length == strlen(name) && !strncmp(at, name, length)) return column;
        at += length + (at[length] == ',');
        if (*at == '\r' || *at == '\n') break;
    }
    return -1;
}

int main(void) {
    static const char *names[4] = {"time_s", "position_m", "velocity_mps", "force_n"};
    char line[4096];
    int columns[4];
    if (!fgets(line, sizeof line, stdin)) return 2;
    for (int k = 0; k < 4; k++) {
        columns[k] = column_of(line, names[k]);
        if (columns[k] < 0) {
            fprintf(stderr, "recording: no column %s\n", names[k]);
            return 2;
        }
    }
    size_t bytes = stylet_size(16384), align = stylet_align();
    void *memory = aligned_alloc(align, (bytes + align - 1) / align * align);
    StyletCore *core;
    const char *why;
    if (stylet_init(memory, bytes, NULL, &core, &why) != STYLET_OK) {
        fprintf(stderr, "%s\n", why);
        return 2;
    }
    while (fgets(line, sizeof line, stdin)) {
        double sample[4] = {0};
        char *at = line;
        for (int column = 0; *at; column++) {
            for (int k = 0; k < 4; k++)
                if (columns[k] == column) sample[k] = strtod(at, NULL);
            at += strcspn(at, ",\n");
            if (*at) at++;
        }
        StyletOutput out;
        if (stylet_step(core, sample[0], sample[1], sample[2], sample[3], &out) < 0) return 2;
        fwrite(&out.enhanced_n, sizeof out.enhanced_n, 1, stdout);
    }
    free(memory);
    return 0;
}
