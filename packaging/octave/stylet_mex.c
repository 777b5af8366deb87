/* MEX interface of the online core, for StyletEnhancer.m: MATLAB and Octave.
 *   handle = stylet_mex('new', config)                  config: struct with fields of StyletConfig, and `samples`
 *   out = stylet_mex('step', handle, t, z, v, f)        columns of equal length; out: struct of columns
 *   stylet_mex('free', handle)
 */
#include <mex.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <stylet.h>

/* Outputs of a step as numbers, in the order of `fields`. */
static const char *fields[] = {"enhanced_n", "low_n", "high_n", "reconstructed_n", "error_n", "stiffness_n_per_m", "friction",
                               "cumulative_friction_ns_per_m", "contact_m", "state", "ruptures", "ruptured", "used"};
enum { FIELDS = sizeof fields / sizeof *fields };

static void read_number(const mxArray *config, const char *name, double *value) {
    const mxArray *field = mxGetField(config, 0, name);
    if (!field) return;
    if (!mxIsNumeric(field) && !mxIsLogical(field)) mexErrMsgIdAndTxt("stylet:config", "%s: must be a number", name);
    *value = mxGetScalar(field);
}

static StyletCore *new_core(const mxArray *given) {
    StyletConfig config;
    stylet_default_config(&config);
    double algorithm = config.algorithm, model = config.model, contact_known = config.contact_known, samples = 16384;
    const struct { const char *name; double *value; } known[] = {
        {"algorithm", &algorithm}, {"model", &model}, {"contact_known", &contact_known}, {"samples", &samples}, {"surface_m", &config.surface_m},
        {"false_alarms_per_hour", &config.false_alarms_per_hour}, {"forgetting", &config.forgetting}, {"prior_stiffness", &config.prior_stiffness},
        {"prior_friction", &config.prior_friction}, {"cusum_sigma_ordinary_n", &config.cusum_sigma_ordinary_n},
        {"cusum_sigma_rupture_n", &config.cusum_sigma_rupture_n}, {"derivative_on_n_per_s", &config.derivative_on_n_per_s},
        {"derivative_off_n_per_s", &config.derivative_off_n_per_s}};
    enum { KNOWN = sizeof known / sizeof *known };
    if (!mxIsStruct(given)) mexErrMsgIdAndTxt("stylet:config", "config: must be a struct");
    for (int k = 0; k < mxGetNumberOfFields(given); k++) {
        const char *name = mxGetFieldNameByNumber(given, k);
        int at = 0;
        while (at < KNOWN && strcmp(known[at].name, name) != 0) at++;
        if (at == KNOWN) mexErrMsgIdAndTxt("stylet:config", "%s: there is no such field; stylet.h, StyletConfig, lists them", name);
        read_number(given, name, known[at].value);
    }
    /* The upper end keeps the memory below 2 GiB. */
    if (!(samples >= 1 && samples <= 5e7)) mexErrMsgIdAndTxt("stylet:config", "samples: must be 1 to 5e7");
    config.algorithm = (int32_t)algorithm;
    config.model = (int32_t)model;
    config.contact_known = (int32_t)contact_known;
    size_t bytes = stylet_size((size_t)samples);
    /* Kept between calls, so not by mxMalloc. `stylet_align` is at most that of malloc. */
    void *memory = malloc(bytes);
    StyletCore *core = NULL;
    const char *why = "no memory";
    if (!memory || stylet_init(memory, bytes, &config, &core, &why) != STYLET_OK) {
        free(memory);
        mexErrMsgIdAndTxt("stylet:config", "%s", why);
    }
    return core;
}

static StyletCore *core_of(const mxArray *handle) {
    if (!mxIsUint64(handle) || mxGetNumberOfElements(handle) != 1 || *(uint64_t *)mxGetData(handle) == 0)
        mexErrMsgIdAndTxt("stylet:handle", "the handle must be that of 'new'");
    return (StyletCore *)(uintptr_t)*(uint64_t *)mxGetData(handle);
}

static mxArray *step(StyletCore *core, const mxArray *columns[]) {
    const double *sample[4];
    size_t count = mxGetNumberOfElements(columns[0]);
    for (int k = 0; k < 4; k++) {
        if (!mxIsDouble(columns[k]) || mxIsComplex(columns[k]) || mxGetNumberOfElements(columns[k]) != count)
            mexErrMsgIdAndTxt("stylet:sample", "time, position, velocity and force must be real doubles of equal length");
        sample[k] = mxGetPr(columns[k]);
    }
    mxArray *result = mxCreateStructMatrix(1, 1, FIELDS, fields);
    double *to[FIELDS];
    for (int k = 0; k < FIELDS; k++) {
        mxArray *column = mxCreateDoubleMatrix(count, 1, mxREAL);
        mxSetFieldByNumber(result, 0, k, column);
        to[k] = mxGetPr(column);
    }
    for (size_t i = 0; i < count; i++) {
        StyletOutput o;
        StyletStatus status = stylet_step(core, sample[0][i], sample[1][i], sample[2][i], sample[3][i], &o);
        if (status < 0) mexErrMsgIdAndTxt("stylet:internal", "%s", stylet_last_error(core));
        const double row[FIELDS] = {o.enhanced_n, o.low_n, o.high_n, o.reconstructed_n, o.error_n, o.stiffness_n_per_m, o.friction,
                                    o.cumulative_friction_ns_per_m, o.contact_m, o.state, o.ruptures, o.ruptured, status == STYLET_OK};
        for (int k = 0; k < FIELDS; k++) to[k][i] = row[k];
    }
    return result;
}

void mexFunction(int nlhs, mxArray *plhs[], int nrhs, const mxArray *prhs[]) {
    char command[8] = "";
    (void)nlhs;
    if (nrhs > 0 && mxIsChar(prhs[0])) mxGetString(prhs[0], command, sizeof command);
    if (!strcmp(command, "new") && nrhs == 2) {
        StyletCore *core = new_core(prhs[1]);
        plhs[0] = mxCreateNumericMatrix(1, 1, mxUINT64_CLASS, mxREAL);
        *(uint64_t *)mxGetData(plhs[0]) = (uint64_t)(uintptr_t)core;
    } else if (!strcmp(command, "step") && nrhs == 6) {
        plhs[0] = step(core_of(prhs[1]), prhs + 2);
    } else if (!strcmp(command, "free") && nrhs == 2) {
        /* The core lies at the begin of its memory. */
        free(core_of(prhs[1]));
    } else {
        mexErrMsgIdAndTxt("stylet:usage", "use StyletEnhancer");
    }
}
