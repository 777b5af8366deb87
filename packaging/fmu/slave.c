/* FMI 2.0 for co-simulation over a model with real and integer variables (slave.h). A step from t to t + h processes the inputs that were
 * set for t as the sample at t; the outputs are those of that sample. */
#include "slave.h"
#include <fmi2Functions.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    fmi2CallbackFunctions callbacks;
    char *name;
    double real[REALS];
    int integer[INTEGERS];
    void *model;
} Instance;

static Values values_of(Instance *instance) { return (Values){instance->real, instance->integer}; }

static void set_start_values(Instance *instance) {
    static const double reals[REALS] = {REAL_START_VALUES};
    static const int integers[INTEGERS] = {INTEGER_START_VALUES};
    memcpy(instance->real, reals, sizeof reals);
    memcpy(instance->integer, integers, sizeof integers);
}

static fmi2Status fail(Instance *instance, const char *why) {
    if (instance->callbacks.logger)
        instance->callbacks.logger(instance->callbacks.componentEnvironment, instance->name, fmi2Error, "error", "%s", why);
    return fmi2Error;
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    (void)c, (void)on, (void)n, (void)categories;
    return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources, const fmi2CallbackFunctions *callbacks,
                              fmi2Boolean visible, fmi2Boolean logging) {
    (void)resources, (void)visible, (void)logging;
    if (type != fmi2CoSimulation || !guid || strcmp(guid, MODEL_GUID) != 0 || !name || !callbacks) return NULL;
    Instance *instance = calloc(1, sizeof *instance);
    if (!instance) return NULL;
    instance->callbacks = *callbacks;
    instance->name = malloc(strlen(name) + 1);
    if (!instance->name) {
        free(instance);
        return NULL;
    }
    strcpy(instance->name, name);
    set_start_values(instance);
    return instance;
}

void fmi2FreeInstance(fmi2Component c) {
    Instance *instance = c;
    if (!instance) return;
    model_free(instance->model);
    free(instance->name);
    free(instance);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start, fmi2Boolean has_stop, fmi2Real stop) {
    (void)c, (void)has_tolerance, (void)tolerance, (void)start, (void)has_stop, (void)stop;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) { (void)c; return fmi2OK; }

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Instance *instance = c;
    const char *why = "no memory";
    model_free(instance->model);
    instance->model = model_new(values_of(instance), &why);
    return instance->model ? fmi2OK : fail(instance, why);
}

fmi2Status fmi2Terminate(fmi2Component c) { (void)c; return fmi2OK; }

fmi2Status fmi2Reset(fmi2Component c) {
    Instance *instance = c;
    model_free(instance->model);
    instance->model = NULL;
    set_start_values(instance);
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    Instance *instance = c;
    for (size_t k = 0; k < n; k++) {
        if (vr[k] >= REALS) return fail(instance, "there is no real variable with this value reference");
        value[k] = instance->real[vr[k]];
    }
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    Instance *instance = c;
    for (size_t k = 0; k < n; k++) {
        if (vr[k] >= REALS) return fail(instance, "there is no real variable with this value reference");
        instance->real[vr[k]] = value[k];
    }
    return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer value[]) {
    Instance *instance = c;
    for (size_t k = 0; k < n; k++) {
        if (vr[k] >= INTEGERS) return fail(instance, "there is no integer variable with this value reference");
        value[k] = instance->integer[vr[k]];
    }
    return fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[]) {
    Instance *instance = c;
    for (size_t k = 0; k < n; k++) {
        if (vr[k] >= INTEGERS) return fail(instance, "there is no integer variable with this value reference");
        instance->integer[vr[k]] = value[k];
    }
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_return) {
    (void)step, (void)no_return;
    Instance *instance = c;
    if (!instance->model) return fail(instance, "fmi2DoStep before fmi2ExitInitializationMode");
    StyletStatus status = model_step(instance->model, time, values_of(instance));
    if (status < 0) return fail(instance, "internal error; please report it");
    return status == STYLET_OK ? fmi2OK : fmi2Warning;
}

/* No variable has one of these types, and the capability flags say that none of these functions may be called. */
#define NOTHING_BUT_THE_EMPTY_LIST return n ? fail(c, "there is no variable of this type") : fmi2OK
fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[]) { (void)vr, (void)value; NOTHING_BUT_THE_EMPTY_LIST; }
fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[]) { (void)vr, (void)value; NOTHING_BUT_THE_EMPTY_LIST; }
fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String value[]) { (void)vr, (void)value; NOTHING_BUT_THE_EMPTY_LIST; }
fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String value[]) { (void)vr, (void)value; NOTHING_BUT_THE_EMPTY_LIST; }
#define NOT_SUPPORTED return fail(c, "not supported")
fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *s) { (void)s; NOT_SUPPORTED; }
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate s) { (void)s; NOT_SUPPORTED; }
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *s) { (void)s; NOT_SUPPORTED; }
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate s, size_t *n) { (void)s, (void)n; NOT_SUPPORTED; }
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate s, fmi2Byte b[], size_t n) { (void)s, (void)b, (void)n; NOT_SUPPORTED; }
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte b[], size_t n, fmi2FMUstate *s) { (void)b, (void)n, (void)s; NOT_SUPPORTED; }
fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference z[], size_t nz, const fmi2ValueReference v[], size_t nv,
                                        const fmi2Real dv[], fmi2Real dz[]) { (void)z, (void)nz, (void)v, (void)nv, (void)dv, (void)dz; NOT_SUPPORTED; }
fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[], const fmi2Real value[]) {
    (void)vr, (void)n, (void)order, (void)value;
    NOT_SUPPORTED;
}
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[], fmi2Real value[]) {
    (void)vr, (void)n, (void)order, (void)value;
    NOT_SUPPORTED;
}
fmi2Status fmi2CancelStep(fmi2Component c) { NOT_SUPPORTED; }
fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind k, fmi2Status *v) { (void)k, (void)v; NOT_SUPPORTED; }
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind k, fmi2Real *v) { (void)k, (void)v; NOT_SUPPORTED; }
fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind k, fmi2Integer *v) { (void)k, (void)v; NOT_SUPPORTED; }
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind k, fmi2Boolean *v) { (void)k, (void)v; NOT_SUPPORTED; }
fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind k, fmi2String *v) { (void)k, (void)v; NOT_SUPPORTED; }
