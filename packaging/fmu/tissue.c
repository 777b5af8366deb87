/* The force of layered tissue as an FMU. */
#include "slave.h"

void *model_new(Values values, const char **why) {
    /* Four values for each layer, from the thickness of the first; layers without thickness are left out. */
    enum { VALUES_PER_LAYER = 4, LAYERS = (FORCE_N - LAYER_1_THICKNESS_M) / VALUES_PER_LAYER };
    StyletLayer layers[LAYERS];
    StyletTissue *tissue;
    size_t count = 0;
    for (int k = 0; k < LAYERS; k++) {
        const double *given = values.real + LAYER_1_THICKNESS_M + k * VALUES_PER_LAYER;
        if (given[0] != 0.0) layers[count++] = (StyletLayer){given[0], given[1], given[2], given[3]};
    }
    /* Before the first sample. */
    values.integer[ACTIVE_LAYER] = 1;
    return stylet_tissue_new(layers, count, values.real[SURFACE_M], &tissue, why) == STYLET_OK ? tissue : NULL;
}

StyletStatus model_step(void *model, double time_s, Values values) {
    StyletForce force;
    StyletStatus status = stylet_tissue_step(model, time_s, values.real[POSITION_M], values.real[VELOCITY_MPS], &force);
    if (status != STYLET_OK) return status;
    values.real[FORCE_N] = force.total_n;
    values.real[ELASTIC_N] = force.elastic_n;
    values.real[FRICTION_N] = force.friction_n;
    values.real[TIP_N] = force.tip_n;
    values.integer[ACTIVE_LAYER] = (int)force.active_layer;
    return status;
}

void model_free(void *model) { stylet_tissue_free(model); }
