/* What a model gives to slave.c, the FMI 2.0 interface for co-simulation that the FMUs of Stylet share. */
#ifndef SLAVE_H
#define SLAVE_H

#include "variables.h"
#include <stylet.h>

/* Values by value reference; variables.h, which build.py writes, has the references. */
typedef struct {
    double *real;
    int *integer;
} Values;

/* Creates the model from its parameters. Returns NULL and sets `*why` when they are refused. */
void *model_new(Values values, const char **why);
/* Processes the sample of the inputs at `time_s` and sets the outputs. */
StyletStatus model_step(void *model, double time_s, Values values);
/* Frees the model; NULL is ignored. */
void model_free(void *model);

#endif
