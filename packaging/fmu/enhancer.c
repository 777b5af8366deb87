/* The online core as an FMU. */
#include "slave.h"
#include <math.h>
#include <stdlib.h>

void *model_new(Values values, const char **why) {
    StyletConfig config;
    StyletCore *core;
    stylet_default_config(&config);
    config.surface_m = values.real[SURFACE_M];
    config.false_alarms_per_hour = values.real[FALSE_ALARMS_PER_HOUR];
    config.algorithm = values.integer[ALGORITHM];
    config.model = values.integer[MODEL];
    config.contact_known = values.integer[CONTACT_KNOWN];
    if (values.integer[SAMPLES] < 1) {
        *why = "samples: must be positive";
        return NULL;
    }
    /* The core lies at the begin of its memory and needs no freeing of its own. */
    size_t align = stylet_align(), bytes = (stylet_size((size_t)values.integer[SAMPLES]) + align - 1) / align * align;
    void *memory = aligned_alloc(align, bytes);
    if (!memory) return NULL;
    if (stylet_init(memory, bytes, &config, &core, why) != STYLET_OK) {
        free(memory);
        return NULL;
    }
    /* Before the first sample. */
    values.real[LOW_N] = values.real[HIGH_N] = values.real[CONTACT_M] = NAN;
    return core;
}

StyletStatus model_step(void *model, double time_s, Values values) {
    StyletOutput out;
    StyletStatus status = stylet_step(model, time_s, values.real[POSITION_M], values.real[VELOCITY_MPS], values.real[FORCE_N], &out);
    if (status < 0) return status;
    values.real[ENHANCED_N] = out.enhanced_n;
    values.real[LOW_N] = out.low_n;
    values.real[HIGH_N] = out.high_n;
    values.real[RECONSTRUCTED_N] = out.reconstructed_n;
    values.real[STIFFNESS_N_PER_M] = out.stiffness_n_per_m;
    values.real[FRICTION] = out.friction;
    values.real[CUMULATIVE_FRICTION_NS_PER_M] = out.cumulative_friction_ns_per_m;
    values.real[CONTACT_M] = out.contact_m;
    values.integer[STATE] = out.state;
    values.integer[RUPTURES] = (int)out.ruptures;
    return status;
}

void model_free(void *model) { free(model); }
