/* The online core of Stylet for control loops (no allocation, caller's memory), and the force of layered tissue. Research software, not a medical device. */

#ifndef STYLET_H
#define STYLET_H

/* Generated from src by cbindgen; do not edit. `cargo test -p stylet-capi -- --ignored` regenerates it. */

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

// Status of a call.
typedef enum StyletStatus {
  // Success.
  STYLET_OK = 0,
  // The sample was ignored; `stylet_last_error` says why. The output repeats the last one.
  STYLET_UNUSED = 1,
  // A pointer is null, or the memory is not aligned.
  STYLET_NULL = -1,
  // The memory is too small: `stylet_size(samples)` bytes are needed.
  STYLET_TOO_SMALL = -2,
  // A value of the configuration or of a layer is not finite or out of range; the message names it.
  STYLET_BAD_CONFIG = -3,
  // Internal error; the core must not be used any more.
  STYLET_INTERNAL = -4,
} StyletStatus;

// Algorithm.
typedef enum StyletAlgorithm {
  // The paper's.
  STYLET_PAPER = 0,
  // The paper's to the letter.
  STYLET_LITERAL = 1,
  // Kalman filters (default). Multi-layer model only: with the Kelvin-Voigt model the paper's algorithm runs.
  STYLET_STYLET = 2,
} StyletAlgorithm;

// Tissue model.
typedef enum StyletModel {
  // Friction proportional to the depth inside the layer.
  STYLET_MULTI_LAYER = 0,
  // A spring and a damper.
  STYLET_KELVIN_VOIGT = 1,
} StyletModel;

// State of the algorithm.
typedef enum StyletState {
  // Ordinary insertion.
  STYLET_NO_RUPTURE = 0,
  // The force derivative has exceeded its threshold.
  STYLET_EXPECTED_RUPTURE = 1,
  // A rupture has just been declared; lasts one sample.
  STYLET_DETECTED_RUPTURE = 2,
  // Waiting for the end of the drop.
  STYLET_FORCE_DROP_MEASURING = 3,
  // The traversed layer is re-estimated and its friction compensated.
  STYLET_FORCE_COMPENSATION = 4,
  // `Stylet` only: the tip is in a gap or beyond the last layer, and no tissue acts on it.
  STYLET_FREE_TIP = 5,
} StyletState;

// The core; it occupies `stylet_size` bytes.
typedef struct StyletCore StyletCore;

// A tissue and which of its layers are ruptured; `stylet_tissue_new` allocates it.
typedef struct StyletTissue StyletTissue;

// Configuration. Fill it with `stylet_default_config`, then change fields.
typedef struct StyletConfig {
  // A `StyletAlgorithm`.
  int32_t algorithm;
  // A `StyletModel`.
  int32_t model;
  // Not zero: the surface is at `surface_m`. Zero: contact is detected in the force.
  int32_t contact_known;
  // Position of the surface in m, for `contact_known`.
  double surface_m;
  // Accepted false alarms per hour of insertion, above 0. The fields below apply to the paper's algorithm.
  double false_alarms_per_hour;
  // Forgetting factor of the recursive least squares, above 0 to 1.
  double forgetting;
  // Prior variance of the stiffness (N/m)^2.
  double prior_stiffness;
  // Prior variance of the friction, in the model's unit squared.
  double prior_friction;
  // CUSUM: standard deviation of the error in ordinary insertion, N.
  double cusum_sigma_ordinary_n;
  // CUSUM: standard deviation of the error at a rupture, N.
  double cusum_sigma_rupture_n;
  // Force derivative that switches the expectation of a rupture on, N/s.
  double derivative_on_n_per_s;
  // Force derivative that switches it off, N/s.
  double derivative_off_n_per_s;
} StyletConfig;

// Output of a step.
typedef struct StyletOutput {
  // Enhanced force in N: measured force less the friction of the passed layers.
  double enhanced_n;
  // Lower end of the 95 % interval of the tip force in N; NaN where the algorithm provides none.
  double low_n;
  // Upper end of that interval in N.
  double high_n;
  // Force predicted before this sample's update, in N.
  double reconstructed_n;
  // Innovation in N.
  double error_n;
  // Stiffness estimate of the active layer in N/m.
  double stiffness_n_per_m;
  // Friction estimate of the active layer: N s/m^2 (multi-layer), N s/m (Kelvin-Voigt).
  double friction;
  // CUSUM in N^2; for `StyletStylet` the largest sum as a fraction of its threshold.
  double cusum_n2;
  // Filtered force derivative in N/s; zero for `StyletStylet`.
  double derivative_n_per_s;
  // Cumulative friction in N s/m.
  double cumulative_friction_ns_per_m;
  // Position of the first contact in m; NaN before.
  double contact_m;
  // A `StyletState`.
  int32_t state;
  // Ruptures declared so far.
  uint32_t ruptures;
  // Not zero at the sample that declares a rupture.
  int32_t ruptured;
  // Layer whose estimate became available at this sample, from 1; otherwise zero.
  uint32_t estimated_layer;
  // Thickness of that layer in m.
  double layer_thickness_m;
  // Stiffness of that layer in N/m.
  double layer_stiffness_n_per_m;
  // Friction of that layer in the model's unit.
  double layer_friction;
  // Not zero when the algorithm was re-initialised before this sample because of a new clock.
  int32_t restarted;
} StyletOutput;

// A layer of a tissue.
typedef struct StyletLayer {
  // Thickness in m, above 0.
  double thickness_m;
  // Stiffness in N/m, zero or positive.
  double stiffness_n_per_m;
  // Friction per metre of needle inside the layer in N s/m^2, zero or positive.
  double friction_ns_per_m2;
  // Elastic force in N at which the layer ruptures; zero: it ruptures at its far face.
  double puncture_n;
} StyletLayer;

// Force of a tissue on the needle.
typedef struct StyletForce {
  // Force at the needle's base in N, positive when it resists the insertion.
  double total_n;
  // Elastic force of the active layer in N.
  double elastic_n;
  // Friction along the shaft in N.
  double friction_n;
  // Force at the tip in N: `total_n` less the friction of the ruptured layers.
  double tip_n;
  // Active layer, from 1; one more than the number of layers after the last rupture.
  uint32_t active_layer;
} StyletForce;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Bytes of a core that stores `samples` samples of a layer (16384: 80 s at 200 Hz).
size_t stylet_size(size_t samples);

// Alignment of that memory in bytes, at most that of `malloc`.
size_t stylet_align(void);

// Version of the library, a static string.
const char *stylet_version(void);

// Sets the default configuration, that of `stylet enhance`.
//
// # Safety
// `config` is null or points to a `StyletConfig`.
enum StyletStatus stylet_default_config(struct StyletConfig *config);

// Creates a core in the caller's `memory` of `bytes` bytes, which stores as many samples as fit behind it (at least one). `config`
// may be null for the defaults. `*core` is the handle; it lives in the memory and needs no freeing. If `why` is not null, `*why` is
// set to a static message, empty on success.
//
// # Safety
// `memory` is null or points to `bytes` bytes that are used by nothing else while the core lives; `config` is null or points to a
// `StyletConfig`; `core` is null or points to a pointer; so does `why`.
enum StyletStatus stylet_init(void *memory,
                              size_t bytes,
                              const struct StyletConfig *config,
                              struct StyletCore **core,
                              const char **why);

// Processes one sample: time in s (increasing), tip position in m (positive into the tissue), tip velocity in m/s, axial force
// in N (positive resisting insertion). `out` may be null.
//
// # Safety
// `core` is null or from `stylet_init`, and its memory is still valid; `out` is null or points to a `StyletOutput`.
enum StyletStatus stylet_step(struct StyletCore *core,
                              double time_s,
                              double position_m,
                              double velocity_mps,
                              double force_n,
                              struct StyletOutput *out);

// Message of the last failed step, a static string; empty before.
//
// # Safety
// `core` is null or from `stylet_init`, and its memory is still valid.
const char *stylet_last_error(const struct StyletCore *core);

// Creates a tissue of `count` layers, whose front face is at `surface_m`. `*tissue` is the handle, to be freed with
// `stylet_tissue_free`. If `why` is not null, `*why` is set to a static message, empty on success.
//
// # Safety
// `layers` is null or points to `count` layers; `tissue` is null or points to a pointer; so does `why`.
enum StyletStatus stylet_tissue_new(const struct StyletLayer *layers,
                                    size_t count,
                                    double surface_m,
                                    struct StyletTissue **tissue,
                                    const char **why);

// Force at a sample: time in s (not decreasing), tip position in m (positive into the tissue), tip velocity in m/s. A layer that has
// ruptured stays ruptured. Allocates nothing. A sample that is not finite gives NaN and changes nothing.
//
// # Safety
// `tissue` is null or from `stylet_tissue_new` and not freed; `force` is null or points to a `StyletForce`.
enum StyletStatus stylet_tissue_step(struct StyletTissue *tissue,
                                     double time_s,
                                     double position_m,
                                     double velocity_mps,
                                     struct StyletForce *force);

// Frees a tissue; null is ignored.
//
// # Safety
// `tissue` is null or from `stylet_tissue_new` and not freed yet.
void stylet_tissue_free(struct StyletTissue *tissue);

// Creates a tissue of `count` layers, whose front face is at `surface_m`. `*tissue` is the handle, to be freed with
// `stylet_tissue_free`. If `why` is not null, `*why` is set to a static message, empty on success.
//
// # Safety
// `layers` is null or points to `count` layers; `tissue` is null or points to a pointer; so does `why`.
enum StyletStatus stylet_tissue_new(const struct StyletLayer *layers,
                                    size_t count,
                                    double surface_m,
                                    struct StyletTissue **tissue,
                                    const char **why);

// Force at a sample: time in s (not decreasing), tip position in m (positive into the tissue), tip velocity in m/s. A layer that has
// ruptured stays ruptured. Allocates nothing. A sample that is not finite gives NaN and changes nothing.
//
// # Safety
// `tissue` is null or from `stylet_tissue_new` and not freed; `force` is null or points to a `StyletForce`.
enum StyletStatus stylet_tissue_step(struct StyletTissue *tissue,
                                     double time_s,
                                     double position_m,
                                     double velocity_mps,
                                     struct StyletForce *force);

// Frees a tissue; null is ignored.
//
// # Safety
// `tissue` is null or from `stylet_tissue_new` and not freed yet.
void stylet_tissue_free(struct StyletTissue *tissue);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* STYLET_H */
