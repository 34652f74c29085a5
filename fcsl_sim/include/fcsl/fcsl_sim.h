/* SPDX-License-Identifier: Apache-2.0
 *
 * The simulator: flies a compiled machine against plant models on an integer nanosecond clock, deterministically.
 *
 * At t_k, the time of controller tick k: states have been integrated up to t_k; due models are updated; sensors are
 * sampled; the controller steps; its actuators hold from t_k on. Controller and plant meet only in messages of channels
 * (fcsl_codec.h), whether the controller is hosted here, in another process or in a ROS 2 node: the bits are the same.
 *
 * A simulation is built from a plan: a flat text that the front end (fcsl_sim, Python) makes from a checked *.sim.json
 * (format: src/plan/plan.h). Not thread-safe: one thread owns a simulation.
 */
#ifndef FCSL_SIM_H
#define FCSL_SIM_H

#include "fcsl/fcsl_external.h"
#include "fcsl/fcsl_model.h"
#include "fcsl/fcsl_publish_queue.h"
#include "fcsl/fcsl_ros.h"
#include "fcsl/fcsl_run.h"
#include "fcsl/fcsl_observers.h"
#include "fcsl/fcsl_ros_graph.h"
#include "fcsl/fcsl_telemetry.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct fcsl_sim fcsl_sim_t;

/* Parses the plan, loads models and machine, initialises everything. `parameters` (null: none): of the controllers, for one of which
 * it has a section at least; `used` of it is not. Null on failure: error names the problem and the line. */
fcsl_sim_t *fcsl_sim_open(const char *plan, size_t size, const fcsl_parameters_t *parameters, fcsl_error_t *error);
/* Stops recording and unloads. */
int fcsl_sim_close(fcsl_sim_t *sim, fcsl_error_t *error);

const fcsl_machine_t *fcsl_sim_machine(const fcsl_sim_t *sim);
/* The last instant, in simulated time. */
int64_t fcsl_sim_time_ns(const fcsl_sim_t *sim);
/* Controller ticks completed, and the largest number of ticks of the simulation. */
uint64_t fcsl_sim_tick(const fcsl_sim_t *sim);
uint64_t fcsl_sim_ticks(const fcsl_sim_t *sim);

typedef enum {
    FCSL_SIM_RUNNING = 0,
    FCSL_SIM_DURATION = 1, /* all ticks done */
    FCSL_SIM_UNTIL = 2     /* the stop condition held long enough */
} fcsl_sim_status_t;

fcsl_sim_status_t fcsl_sim_status(const fcsl_sim_t *sim);

/* ---- controller in this process ---------------------------------------------------------------------------------- */

/* Records controller and plant truth into a bag, from the next tick on. Topics of the plant: /<ns>/sim/<instance>.
 * `split`: as of fcsl_record_options_t. */
int fcsl_sim_record(fcsl_sim_t *sim, const char *bag, const char *name_space, const char *split, fcsl_error_t *error);
int fcsl_sim_record_stop(fcsl_sim_t *sim, fcsl_error_t *error);

/* Runs up to `ticks` ticks. Returns early when the simulation is over, after a tick in which the machine's state changed,
 * and after a wait for a tick that is not due (fcsl_sim_set_speed) or for a client that keeps the simulation paused.
 * Returns ticks done, or -1. */
int64_t fcsl_sim_run(fcsl_sim_t *sim, uint64_t ticks, fcsl_error_t *error);
typedef struct {
    const void *data; /* within the struct of a machine or of an instance */
    uint32_t size;
} fcsl_sim_part_t;
/* As fcsl_sim_run, past changes of the state, too; after each tick the parts are appended to `rows`, which has room for all.
 * `done`: ticks that were run, also before an error. Returns 0, or -1. */
int fcsl_sim_run_traced(fcsl_sim_t *sim, uint64_t ticks, const fcsl_sim_part_t *parts, uint32_t count, uint8_t *rows,
                        uint64_t *done, fcsl_error_t *error);
/* Limits fcsl_sim_run to `speed` simulated seconds per second of the monotonic clock, from its next tick and from the end
 * of a pause on; 0, the default: as fast as possible. A late tick runs at once. fcsl_sim_run waits for 50 ms at most, or
 * until a signal, and returns, so that its caller can do other work. Ticks that a client requests from a paused simulation,
 * and those of fcsl_sim_sense, run at once. */
int fcsl_sim_set_speed(fcsl_sim_t *sim, double speed, fcsl_error_t *error);
/* The hosted machine's state in the last completed tick (an index into states). */
int32_t fcsl_sim_state(const fcsl_sim_t *sim);
/* The hosted machine's struct, to read from. */
const void *fcsl_sim_machine_data(const fcsl_sim_t *sim);

/* ---- further controllers --------------------------------------------------------------------------------------------- */

/* Controllers hosted beside the first one, in the plan's order. Each steps at its own rate; their runs are to read from and to write
 * into between two ticks. fcsl_sim_record records them into bags of their own, BAG_NAME. */
uint32_t fcsl_sim_companion_count(const fcsl_sim_t *sim);
const char *fcsl_sim_companion_name(const fcsl_sim_t *sim, uint32_t companion);
fcsl_run_t *fcsl_sim_companion(fcsl_sim_t *sim, uint32_t companion);
/* The state in its last completed tick, and how many there were. */
const char *fcsl_sim_companion_state(const fcsl_sim_t *sim, uint32_t companion, uint64_t *ticks);

/* ---- models that crash or hang ---------------------------------------------------------------------------------------- */

/* The function of a model that runs. While `entry` is the same, it is the same call. */
typedef struct {
    char instance[256]; /* empty: none; a longer name is cut */
    const char *function;
    uint64_t entry;
    int64_t time_ns; /* of the last instant */
} fcsl_sim_running_call_t;

/* These two are of the simulation that was opened last, from the beginning of fcsl_sim_open on.
 *
 * From any thread: whether a function of a model runs now, and which. */
int fcsl_sim_running_call(fcsl_sim_running_call_t *at);
/* From now on a crash within a model ends the process with status 2 and a message that names instance, function and time; with
 * `json` also as JSON on standard output. `watch` 0: no longer. Returns 0, or -1. */
int fcsl_sim_watch_crashes(int watch, int json, fcsl_error_t *error);

/* ---- writing, checkpoints ------------------------------------------------------------------------------------------ */

/* The hosted machine, to write into between two ticks and to trace (fcsl_run.h); it is stepped by the simulation alone. */
fcsl_run_t *fcsl_sim_hosted(fcsl_sim_t *sim);
/* Replaces `size` bytes of the struct of an instance, between two ticks. The next evaluation overwrites outputs and connected
 * inputs. Returns 0, or -1: not within the struct. */
int fcsl_sim_write(fcsl_sim_t *sim, uint32_t instance, uint32_t offset, const void *bytes, uint32_t size,
                   fcsl_error_t *error);

/* A checkpoint is all that a simulation needs to go on as if it had never stopped, between two ticks: plant, machine,
 * hardware, integrators, noise. Its bytes are the content of its file. */
size_t fcsl_sim_checkpoint_capacity(const fcsl_sim_t *sim);
/* Writes it into `bytes`, which has that capacity; returns its bytes. 0: a serial line cannot be restored. */
size_t fcsl_sim_checkpoint(const fcsl_sim_t *sim, void *bytes);
/* Puts it back, into a simulation of the same models, integrators, rates and machine. Its own scheduled writes go on; those until
 * the checkpoint's time are passed over. Other bytes are refused with the reason, and nothing is changed then. */
int fcsl_sim_restore_checkpoint(fcsl_sim_t *sim, const void *bytes, size_t size, fcsl_error_t *error);

/* ---- the plant as equations ---------------------------------------------------------------------------------------- */

/* Number of continuous states of all instances. */
uint32_t fcsl_sim_slope_count(const fcsl_sim_t *sim);
/* Between two ticks: outputs at the present from the states and inputs that the structs of instances hold, then all derivatives,
 * in the order of instances and of their states. Connections within a group count; inputs from a controller or a sensor stay as they
 * are. Nothing advances. Fails where a derivative is not finite. */
int fcsl_sim_slopes(fcsl_sim_t *sim, double *slopes, fcsl_error_t *error);

/* ---- external controller ------------------------------------------------------------------------------------------- */

/* `peer`: wire:SPEC (fcsl_wire.h) or zenoh:tcp:HOST:PORT (fcsl_hal.h), as the --hal of fcsl-fc, which can connect from now on;
 * `name_space` stands in front of the keys of the bus. With ,free-running behind an address of the bus nobody waits: give a speed,
 * and fcsl_sim_run puts the sensors of each tick and takes the newest command, or holds the one before. */
int fcsl_sim_listen(fcsl_sim_t *sim, const char *peer, const char *name_space, uint32_t timeout_ms,
                    fcsl_error_t *error);
/* Waits up to wait_ms for the connection: 0, or 1 when nobody has come. Then fcsl_sim_run steps in lock-step with the controller. A
 * missing answer after timeout_ms is an error that names its tick. */
int fcsl_sim_accept(fcsl_sim_t *sim, uint32_t wait_ms, fcsl_error_t *error);

/* Free-running: the oldest line about a controller that came or went, 1; or 0 where there is none. And what came of it. */
int fcsl_sim_read_log(fcsl_sim_t *sim, char text[FCSL_LOG_BYTES]);
void fcsl_sim_count_commands(const fcsl_sim_t *sim, fcsl_external_counters_t *counters);

/* Steps several simulations, each with an external controller, together: tick k of all that run, then tick k + 1. Ends after
 * `ticks` ticks, after about slice_ms, or when all are over; a tick may then be under way, and goes on with the next call. The
 * first one has the speed (fcsl_sim_set_speed). Returns the ticks completed, or -1 with `failed` the number of the simulation. */
int64_t fcsl_sim_run_together(fcsl_sim_t *const *sims, uint32_t count, uint64_t ticks, uint32_t slice_ms,
                              uint32_t *failed, fcsl_error_t *error);
/* While no tick is run, called often: the controller waits on. */
void fcsl_sim_keep_alive(fcsl_sim_t *sim);
/* Tells the controller that the run is over, and whether another one follows. */
void fcsl_sim_end(fcsl_sim_t *sim, int another_follows);

/* ---- ROS 2 topics ------------------------------------------------------------------------------------------------------ */

/* Messages of each tick of fcsl_sim_run_together, before the controller answers it, go into a publish queue under the number of their
 * topic. All are added before the first tick; queue and composers must outlive the simulation. `every`: those of every n-th tick.
 * Each function returns 0, or -1. */
int fcsl_sim_show_clock(fcsl_sim_t *sim, fcsl_publish_queue_t *queue, uint32_t topic, fcsl_error_t *error);
/* fcsl_msgs/PlantTruth: `head` is its CDR up to the first value. */
int fcsl_sim_show_truth(fcsl_sim_t *sim, fcsl_publish_queue_t *queue, uint32_t topic, const uint8_t *head,
                        uint32_t head_size, uint32_t every, fcsl_error_t *error);
/* A message of `size` bytes composed of the structs of instances. */
int fcsl_sim_show_instances(fcsl_sim_t *sim, fcsl_publish_queue_t *queue, uint32_t topic,
                            const fcsl_ros_composer_t *composer, uint32_t size, const uint32_t *instances,
                            uint32_t count, uint32_t every, fcsl_error_t *error);
/* A message composed of sensor channels, when one of these was sampled. */
int fcsl_sim_show_channels(fcsl_sim_t *sim, fcsl_publish_queue_t *queue, uint32_t topic,
                           const fcsl_ros_composer_t *composer, uint32_t size, const uint32_t *channels, uint32_t count,
                           fcsl_error_t *error);

/* ---- variable server ----------------------------------------------------------------------------------------------- */

/* Serves every variable on `address` (fcsl_vars.h) from now on; only before the first tick. The hosted machine's variables
 * have their own paths, a model's are below the name of its instance. fcsl_sim_run executes commands between ticks. While
 * paused it runs no ticks, waits a while for commands and returns, so that its caller can do other work. `token`,
 * `checkpoints`: as in fcsl_vars.h, or null. */
int fcsl_sim_serve(fcsl_sim_t *sim, const char *address, const char *token, const char *checkpoints, int paused,
                   fcsl_error_t *error);
/* The address of the variable server, or null. */
const char *fcsl_sim_address(const fcsl_sim_t *sim);

/* ---- telemetry ------------------------------------------------------------------------------------------------------ */

/* Sends the selected fields of the variables that fcsl_sim_serve serves as UDP (fcsl_telemetry.h: `address`, `fields` or
 * null) from now on; only before the first tick and before fcsl_sim_serve. */
int fcsl_sim_telemetry(fcsl_sim_t *sim, const char *address, const char *fields, fcsl_error_t *error);
/* Sends the remaining packets and stops; returns the counts, all 0 if telemetry was off. */
void fcsl_sim_telemetry_stop(fcsl_sim_t *sim, fcsl_telemetry_counters_t *counters);

/* ---- observers ------------------------------------------------------------------------------------------------------ */

/* The channels of the hosted machine on a bus that listens on `endpoint` (fcsl_observers.h) from now on; only before the first
 * tick and before fcsl_sim_serve. */
int fcsl_sim_observers(fcsl_sim_t *sim, const char *endpoint, const char *name_space, fcsl_error_t *error);
/* Puts the remaining ticks and stops; returns the counts, all 0 if there were no observers. */
void fcsl_sim_observers_stop(fcsl_sim_t *sim, fcsl_observers_counters_t *counters);

/* The same of the hosted machine's ROS 2 topics and /clock, for a bridge that connects to `endpoint` (fcsl_ros_graph.h). */
int fcsl_sim_ros(fcsl_sim_t *sim, const char *endpoint, const char *name_space, fcsl_error_t *error);
void fcsl_sim_ros_stop(fcsl_sim_t *sim, fcsl_ros_graph_counters_t *counters);

/* ---- controller driven by the caller --------------------------------------------------------------------------------- */

/* Advances to the next tick and writes its sensor message. Returns its bytes, or -1. Between sense and actuate the
 * truth of that tick can be read. */
int64_t fcsl_sim_sense(fcsl_sim_t *sim, uint8_t *message, size_t capacity, fcsl_error_t *error);
/* The content of the last sensor message: a machine struct of which only the channels are defined; and whether a channel
 * (an index into channels) was sampled for that tick. */
const void *fcsl_sim_channel_data(const fcsl_sim_t *sim);
int fcsl_sim_sampled(const fcsl_sim_t *sim, uint32_t channel);
/* Takes the actuator message of the sensed tick, and completes the tick. */
int fcsl_sim_actuate(fcsl_sim_t *sim, const uint8_t *message, size_t size, fcsl_error_t *error);
/* Bytes of the largest message of either direction. */
size_t fcsl_sim_message_capacity(const fcsl_sim_t *sim);

/* ---- truth --------------------------------------------------------------------------------------------------------- */

uint32_t fcsl_sim_instance_count(const fcsl_sim_t *sim);
const char *fcsl_sim_instance_name(const fcsl_sim_t *sim, uint32_t instance);
const fcsl_model_t *fcsl_sim_instance_model(const fcsl_sim_t *sim, uint32_t instance);
/* The instance's struct, to be read through the model's field table. */
const void *fcsl_sim_instance_data(const fcsl_sim_t *sim, uint32_t instance);

/* The outputs of one instance as a generated ROS 2 message ("fcsl_sim/msg/LanderPlant"), stamped with the time of the
 * last sensed tick: type, complete ros2msg schema, CDR. model_message returns its bytes (the same for every tick), or -1. */
const char *fcsl_sim_model_message_type(const fcsl_sim_t *sim, uint32_t instance);
const char *fcsl_sim_model_message_schema(const fcsl_sim_t *sim, uint32_t instance);
int64_t fcsl_sim_model_message(const fcsl_sim_t *sim, uint32_t instance, uint8_t *cdr, size_t capacity);
/* Every scalar output of every instance as a double, in the order of instances and fields; integers beyond 2^53 are
 * rounded. Writes at most `capacity` values; returns the total number. */
uint32_t fcsl_sim_truth_values(const fcsl_sim_t *sim, double *values, uint32_t capacity);

/* ---- for the front end -------------------------------------------------------------------------------------------- */

/* Tab-separated description of a model (format: src/output/describe_model.c), validated as by fcsl_sim_open. Writes at most `capacity`
 * bytes; returns the bytes of the whole text, or -1. */
int64_t fcsl_sim_describe_model(const char *library, const char *name, char *text, size_t capacity,
                                fcsl_error_t *error);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_SIM_H */
