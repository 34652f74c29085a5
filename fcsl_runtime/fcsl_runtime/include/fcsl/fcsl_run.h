/* SPDX-License-Identifier: Apache-2.0
 *
 * A run: one machine being hosted. Flight program, simulator, ROS 2 node and twin all host machines through this file,
 * so all of them load, write, step and record in the same way.
 *
 * Every write goes through the run and, while recording, into the bag at its tick: a run is reproducible from its record.
 * Not thread-safe: one thread owns a run.
 */
#ifndef FCSL_RUN_H
#define FCSL_RUN_H

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_codec.h"
#include "fcsl/fcsl_hw_sim.h"
#include "fcsl/fcsl_machine.h"
#include "fcsl/fcsl_monitor.h"
#include "fcsl/fcsl_parameters.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct fcsl_run fcsl_run_t;

/* Loads `library` and initialises its machine named `machine` (null: the library must hold exactly one). Values of `parameters`
 * (null: none) take the place of the compiled ones before any start() runs, so that they are part of the run's beginning.
 * Refuses another ABI version, descriptors that do not check out, parameters that are not the machine's, and a start() that
 * faults. */
fcsl_run_t *fcsl_run_open(const char *library, const char *machine, const fcsl_parameters_t *parameters,
                          fcsl_error_t *error);
/* The same for a descriptor that the caller has (PyTwin puts Python behind its functions); it must outlive the run. */
fcsl_run_t *fcsl_run_open_machine(const fcsl_machine_t *machine, const fcsl_parameters_t *parameters,
                                  fcsl_error_t *error);
/* Stops recording (see fcsl_run_record_stop) and unloads. */
int fcsl_run_close(fcsl_run_t *run, fcsl_error_t *error);

const fcsl_machine_t *fcsl_run_machine(const fcsl_run_t *run);
/* The machine struct, to read from. */
const void *fcsl_run_data(const fcsl_run_t *run);
uint64_t fcsl_run_tick(const fcsl_run_t *run);

/* Time of tick k: floor(k * 1e9 / tick_hz) ns, exact for every k that fits. */
uint64_t fcsl_run_tick_time_ns(const fcsl_run_t *run, uint64_t tick);

/* Writes `size` bytes (whole scalars) from scalar `element` of a field on. Refused: fields without FCSL_FIELD_WRITABLE,
 * scalars outside the field, bools other than 0 and 1, and of a parameter with a range values outside it, NaN included.
 * A connected input keeps what is written until its instance runs: its source is copied over it. */
int fcsl_run_set(fcsl_run_t *run, uint32_t field, uint32_t element, const void *bytes, uint32_t size,
                 fcsl_error_t *error);
/* Checks what fcsl_run_set checks, and writes nothing. */
int fcsl_run_check_set(const fcsl_run_t *run, uint32_t field, uint32_t element, const void *bytes, uint32_t size,
                       fcsl_error_t *error);
/* Writes what fcsl_run_check_set accepted. Several writes of which all or none take force: check all, then write all. */
void fcsl_run_set_checked(fcsl_run_t *run, uint32_t field, uint32_t element, const void *bytes, uint32_t size);
/* Checks `size` bytes of scalars against the type and the range of a field of a machine, or of a model (null `machine`).
 * The reason in `error` continues a sentence that begins with the field's path. */
int fcsl_check_value(const fcsl_machine_t *machine, const fcsl_field_t *field, const void *bytes, uint32_t size,
                     fcsl_error_t *error);
int fcsl_run_set_state(fcsl_run_t *run, int32_t state, fcsl_error_t *error);
/* The next execute of this instance counts as an overrun. Refused for instances without max_wcet_us. */
int fcsl_run_inject_overrun(fcsl_run_t *run, uint32_t instance, fcsl_error_t *error);
/* The next execute of this instance counts as a fault: its outputs and state stay, its health is failed. */
int fcsl_run_inject_fault(fcsl_run_t *run, uint32_t instance, fcsl_error_t *error);
/* After its next execute this instance is at least FCSL_DEGRADED or FCSL_FAILED, whatever it says itself. */
int fcsl_run_inject_health(fcsl_run_t *run, uint32_t instance, fcsl_health_t health, fcsl_error_t *error);
/* The machine struct with canonical NaNs, and what the requirements remember behind it: fcsl_run_save_bytes. `size` may be the
 * machine's: the struct alone, with which the requirements begin anew. A checkpoint says of which machine it is. */
uint32_t fcsl_run_save_bytes(const fcsl_run_t *run);
int fcsl_run_save(const fcsl_run_t *run, void *bytes, uint32_t size, fcsl_error_t *error);
int fcsl_run_restore(fcsl_run_t *run, const void *bytes, uint32_t size, fcsl_error_t *error);

/* From here on a HAL serves the sensor channels: their age and validity are kept. */
int fcsl_run_attach(fcsl_run_t *run, fcsl_error_t *error);
/* The same of one sensor channel. */
int fcsl_run_attach_channel(fcsl_run_t *run, uint32_t channel, fcsl_error_t *error);
/* Takes the sensor message of the coming tick. A malformed one, or one of another tick, is refused, counted, changes nothing. */
int fcsl_run_sense(fcsl_run_t *run, const uint8_t *bytes, size_t size, fcsl_error_t *error);
/* The same of a message that was checked already. */
int fcsl_run_sense_message(fcsl_run_t *run, const fcsl_message_t *message, fcsl_error_t *error);
/* Writes one sample of a sensor channel for the coming tick: `size` bytes of row-major scalars, little-endian, as in a
 * message. `age_ticks`: how old it is in that tick; `stamp_ns`: its own time, 0 when it has none. */
int fcsl_run_write_channel(fcsl_run_t *run, uint32_t channel, const void *bytes, uint32_t size, uint32_t age_ticks,
                           int64_t stamp_ns, fcsl_error_t *error);
uint64_t fcsl_run_messages_refused(const fcsl_run_t *run);
/* Whether the actuators get what the machine commands: its arm field says so, or it has none; and no arming is required. */
int fcsl_run_is_armed(const fcsl_run_t *run);
/* A host of real actuators has restored a checkpoint into a run that was disarmed. If the checkpoint was armed, the run stays
 * disarmed until the arm field has been false after a step: the machine must arm anew. Changes nothing of the machine. */
void fcsl_run_require_arming(fcsl_run_t *run);
/* Whether that step is still to come. */
int fcsl_run_requires_arming(const fcsl_run_t *run);
/* Writes the actuator message of the last tick; returns its bytes, or -1 when `capacity` is too small. It is armed as
 * fcsl_run_is_armed says. */
int64_t fcsl_run_actuate(const fcsl_run_t *run, uint8_t *bytes, size_t capacity);
/* The same as a message; 0, or -1. */
int fcsl_run_actuate_message(const fcsl_run_t *run, uint8_t *bytes, size_t capacity, fcsl_message_t *message);
/* A struct of the machine of which the fields of actuator channels hold what the actuators get after the last tick: its own
 * while it is armed, and one with their safe values. */
const void *fcsl_run_actuator_data(const fcsl_run_t *run);
/* A struct of the machine whose actuator channels hold their safe values; null where nothing arms the machine. */
const void *fcsl_run_safe_data(const fcsl_run_t *run);
/* The channels of its machine. */
const fcsl_channel_table_t *fcsl_run_channels(const fcsl_run_t *run);

/* A monotonic clock for max_wcet_us; null (the default) times nothing. */
void fcsl_run_set_clock(fcsl_run_t *run, uint64_t (*clock_ns)(void *ctx), void *ctx);
/* The monotonic clock of this machine. */
uint64_t fcsl_run_monotonic_ns(void *ctx);

/* What the hw_* builtins of an algorithm reach: simulated hardware, until a board takes its place. Put in readings and look
 * up writes between ticks. */
fcsl_hw_sim_t *fcsl_run_simulated_hardware(fcsl_run_t *run);
/* Opens a board library (fcsl_hw.h), which fcsl_run_close closes. */
int fcsl_run_open_board(fcsl_run_t *run, const char *library, fcsl_error_t *error);
/* The caller's board, which must last until it is taken back with null: the simulated hardware has its place again then. */
void fcsl_run_use_board(fcsl_run_t *run, const struct fcsl_hw *board);
/* Whether a board has taken the place of the simulated hardware. */
int fcsl_run_has_board(const fcsl_run_t *run);
/* Reads and writes that the simulated hardware or the board refused. */
uint64_t fcsl_run_hardware_failures(const fcsl_run_t *run);

/* What the instance left when it executed in the coming tick of a record (FCSL_WRITE_IMPURE) takes the place of executing
 * it. Refused for instances that neither read hardware nor call externs. */
int fcsl_run_substitute(fcsl_run_t *run, uint32_t instance, const void *bytes, uint32_t size, fcsl_error_t *error);
/* Executes of such instances that no substitute took the place of: a replay whose record is complete has none. */
uint64_t fcsl_run_impure_executes(const fcsl_run_t *run);
/* Ticks run in the floating-point mode of IEEE 754, whatever the caller's is. How often such an instance left another one, and
 * the last that did (null: none): its C code changed it, or loaded a library that does. Its own results of that execute may
 * have other bits. */
uint64_t fcsl_run_mode_changes(const fcsl_run_t *run, const char **by);
/* Sets that mode in the calling thread, and returns the caller's, for what a host computes itself. */
uint64_t fcsl_run_enter_mode(void);
void fcsl_run_leave_mode(uint64_t callers);
uint64_t fcsl_run_ieee_mode(void); /* what fcsl_run_enter_mode returns where nobody changed it */

/* Runs `ticks` ticks. Fails when a lossless recording fails, or when the machine leaves its tick where it was (compiled ones never do:
 * a descriptor of the caller's may have had to give up); the ticks before it are done. */
int fcsl_run_step(fcsl_run_t *run, uint64_t ticks, fcsl_error_t *error);
/* Runs one tick; returns the ticks completed since init, or -1. */
int64_t fcsl_run_step_once(fcsl_run_t *run, fcsl_error_t *error);

#define FCSL_NO_CHANNEL UINT32_MAX

/* A sample, or the value of a field, and when it is delivered. The scalars of a sample are as fcsl_run_write_channel takes
 * them, those of a field as fcsl_run_set does. */
typedef struct {
    uint64_t tick; /* the first tick that sees it */
    int64_t stamp_ns;
    uint32_t channel; /* FCSL_NO_CHANNEL: a value of `field` */
    uint32_t age_ticks; /* in that tick */
    uint64_t payload; /* where its scalars begin */
    uint32_t field; /* these three of values of fields alone */
    uint32_t element;
    uint32_t size;
} fcsl_sample_t;

/* Samples of one channel, in order of tick; sample i has the scalars at values + rows[i] * row_bytes. */
typedef struct {
    const int64_t *ticks; /* the first that sees each */
    const int64_t *ages_ticks;
    const int64_t *stamps_ns;
    const int64_t *rows;
    const uint8_t *values;
    uint64_t row_bytes;
    uint64_t row_count;
    uint64_t count;
    uint64_t next; /* the first sample that was not delivered */
    uint32_t channel;
} fcsl_series_t;

/* Runs all ticks from the coming one to before tick `end`, delivering each of `count` samples (in order of tick, all of
 * these ticks) before its tick. Fails where fcsl_run_write_channel, fcsl_run_set or fcsl_run_step do; what came before is done. */
int fcsl_run_feed(fcsl_run_t *run, const fcsl_sample_t *samples, size_t count, const void *payloads,
                  uint64_t payload_bytes, uint64_t end, fcsl_error_t *error);
/* The same with samples of several channels; those of one tick are delivered in the order of `series`. A series goes on where
 * the last call left it. */
int fcsl_run_feed_series(fcsl_run_t *run, fcsl_series_t *series, uint32_t count, uint64_t end, fcsl_error_t *error);

/* What a host did, as recorded on /<ns>/<machine>/record/writes (fcsl_msgs/HostWrite) at the tick that is the first to see
 * it: doing the same again before that tick reproduces the run. `data` is little-endian with canonical NaNs. */
typedef enum {
    FCSL_WRITE_SET = 0, /* path: a field; element: its first scalar; data: the scalars */
    FCSL_WRITE_SET_STATE = 1, /* path: the state */
    FCSL_WRITE_RESTORE = 2, /* data: as fcsl_run_restore takes it */
    FCSL_WRITE_CHANNEL = 3, /* path: a sensor channel; data: its sample; age_ticks, stamp_ns: of the sample */
    FCSL_WRITE_OVERRUN = 4, /* path: an instance; injected, or found by the clock in that very tick */
    /* path: a sensor channel, or empty for all; one that precedes the record shows in its checkpoint instead */
    FCSL_WRITE_ATTACH = 5,
    /* path: an instance that reads hardware or calls externs; data: its outputs, state and count of faults as its execute
     * of that very tick left them, in the order of the fields */
    FCSL_WRITE_IMPURE = 6,
    FCSL_WRITE_FAULT = 7, /* path: an instance; fcsl_run_inject_fault */
    FCSL_WRITE_HEALTH = 8, /* path: an instance; element: the health; fcsl_run_inject_health */
    /* path: as that of FCSL_WRITE_IMPURE; data: the events of that execute: for each the number of its site within the
     * instance, and its values, u64 each */
    FCSL_WRITE_EVENTS = 9,
    FCSL_WRITE_LOST = 10 /* element: how many host writes from this tick on are not in the record, for want of room */
} fcsl_write_kind_t;

/* ---- checkpoints ------------------------------------------------------------------------------------------------ */

/* A checkpoint is all that a run needs to go on as if it had never stopped: the machine struct, what the requirements remember,
 * and the simulated hardware, and of which machine, sources, layout and tick they are (docs/guide/recording.md). Its bytes are
 * the content of its file. */

/* Bytes of the largest checkpoint of this run. */
size_t fcsl_run_checkpoint_capacity(const fcsl_run_t *run);
/* Writes the checkpoint into `bytes`, which has that capacity; returns its bytes. */
size_t fcsl_run_checkpoint(const fcsl_run_t *run, void *bytes);
/* Puts a checkpoint back. Any bytes are one of this machine or are refused with the reason, and nothing is changed then.
 * `ignore_source_hash`: non-zero takes one of other sources too, if the layout is the same. Recorded as fcsl_run_restore is. */
int fcsl_run_restore_checkpoint(fcsl_run_t *run, const void *bytes, size_t size, int ignore_source_hash,
                                fcsl_error_t *error);
/* The tick that fcsl_run_restore_checkpoint would go to; refuses what it refuses for the head's sake, and changes nothing. */
int fcsl_run_checkpoint_tick(const fcsl_run_t *run, const void *bytes, size_t size, int ignore_source_hash,
                             uint64_t *tick, fcsl_error_t *error);
/* Replaces the file `path` by the checkpoint: whatever happens meanwhile, it is the old file or the new one, whole. Waits
 * for the disk. */
int fcsl_run_save_file(const fcsl_run_t *run, const char *path, fcsl_error_t *error);
int fcsl_run_restore_file(fcsl_run_t *run, const char *path, int ignore_source_hash, fcsl_error_t *error);

/* ---- traces ----------------------------------------------------------------------------------------------------- */

/* A part of the machine struct. */
typedef struct {
    uint32_t offset;
    uint32_t size;
} fcsl_range_t;

typedef struct fcsl_trace fcsl_trace_t;

/* From here on every completed tick leaves a row: the bytes of the ranges, one after another, as they are then. The last
 * `capacity` rows are kept. Null when a range lies outside the struct or memory is short. Ends with the run, at the latest. */
fcsl_trace_t *fcsl_run_trace_begin(fcsl_run_t *run, const fcsl_range_t *ranges, uint32_t count, uint64_t capacity,
                                   fcsl_error_t *error);
/* Rows taken so far, those that are no longer kept included. */
uint64_t fcsl_run_trace_rows(const fcsl_trace_t *trace);
/* Copies `count` rows from row `first` (counted from 0) on. Refused where one of them is not kept, or not taken yet. */
int fcsl_run_trace_read(const fcsl_trace_t *trace, uint64_t first, uint64_t count, void *rows, fcsl_error_t *error);
void fcsl_run_trace_end(fcsl_run_t *run, fcsl_trace_t *trace);

/* ---- requirements ----------------------------------------------------------------------------------------------- */

typedef enum {
    FCSL_MET = 0,
    FCSL_VIOLATED = 1,
    FCSL_NOT_EXERCISED = 2 /* its `when` never held, or it was never evaluated */
} fcsl_verdict_status_t;

/* A requirement of the machine, after the ticks so far. */
typedef struct {
    const fcsl_requirement_t *requirement;
    uint8_t status; /* fcsl_verdict_status_t */
    uint8_t holds; /* at its last evaluation */
    uint64_t evaluated; /* ticks in which it was */
    uint64_t exercised; /* of these, those in which its `when` held */
    uint64_t undefined; /* of these, those in which its `when` compared a NaN */
    uint64_t faults; /* ticks in which an integer overflowed, or was divided by 0: it was not evaluated */
    uint64_t violations; /* how often a violation began; the rest only with one */
    uint64_t violated_ticks;
    uint64_t first_tick;
    uint64_t last_tick;
    uint64_t forgot_before; /* tick of a restore that brought no memory of the requirements: they began anew; 0: none */
} fcsl_verdict_t;

enum { FCSL_VERDICT_TEXT_MAX = 1280, FCSL_KEPT_LAST = 8 };

/* Those of a library come with it; this gives a run the monitor of another machine that has the same fields. */
int fcsl_run_use_monitor(fcsl_run_t *run, const fcsl_monitor_t *monitor, fcsl_error_t *error);
/* The requirements of a run; null without. */
const fcsl_monitor_t *fcsl_run_monitor(const fcsl_run_t *run);
/* The monitor's struct, to read from; null without one. */
const void *fcsl_run_monitor_data(const fcsl_run_t *run);
/* Evaluates the requirements on recorded values, without running the machine: `count` rows of `row_bytes`, each of which has
 * the values of `observed` one after another, as they stood after a tick. */
void fcsl_run_judge(fcsl_run_t *run, const uint8_t *rows, uint64_t row_bytes, uint64_t count);
/* Gathers the verdicts as they are now in rows that observers may copy, of the same address and size each time; null without
 * requirements. From the thread that steps. */
const void *fcsl_run_gather_verdicts(fcsl_run_t *run, uint32_t *size);
/* What is served of the rows: `<instance>.violations` and its like, none writable; null without requirements. */
const fcsl_field_t *fcsl_run_verdict_fields(const fcsl_run_t *run, uint32_t *count);
/* `rows`: of fcsl_run_gather_verdicts, or a copy; `index`: of a requirement of the monitor. */
void fcsl_run_verdict(const fcsl_run_t *run, const void *rows, uint32_t index, fcsl_verdict_t *verdict);
/* The values that a requirement has kept of the first tick that violated it, as fields of the rows with the paths of the machine;
 * those of the last tick are FCSL_KEPT_LAST bytes behind them. Without a violation they mean nothing. */
const fcsl_field_t *fcsl_run_kept_values(const fcsl_run_t *run, uint32_t index, uint32_t *count);
/* "LND-4 violated 1 time, first at tick 812 (8.12 s), last at tick 815: …" */
void fcsl_run_verdict_text(const fcsl_run_t *run, const fcsl_verdict_t *verdict, char text[FCSL_VERDICT_TEXT_MAX]);

/* ---- events ------------------------------------------------------------------------------------------------------ */

/* The last events are kept. Of one event of one instance so many are told in each second of the machine, the others are
 * counted. */
enum { FCSL_EVENTS_KEPT = 1024, FCSL_EVENTS_PER_SECOND = 10, FCSL_EVENT_TEXT_MAX = 256 };

/* An event that a machine reported (fcsl_machine.h). */
typedef struct {
    uint64_t tick;
    uint32_t site; /* index into event_sites */
    uint32_t suppressed; /* of this site since the one before it */
    uint64_t values[FCSL_EVENT_VALUES];
} fcsl_told_event_t;

typedef struct {
    uint64_t told;
    uint64_t suppressed; /* too many of a site in a second */
    uint64_t lost; /* too many in a tick: FCSL_EVENTS_PER_TICK */
} fcsl_event_counts_t;

/* These three may be called from any thread. */
fcsl_event_counts_t fcsl_run_event_counts(const fcsl_run_t *run);
/* Event `number`, counted from 0; 0, or -1: not told yet, or no longer kept. */
int fcsl_run_event(const fcsl_run_t *run, uint64_t number, fcsl_told_event_t *event);
/* The first event from `number` on that is kept, and returns the number behind it; 0: there is none. */
uint64_t fcsl_run_next_event(const fcsl_run_t *run, uint64_t number, fcsl_told_event_t *event);
/* "gate passed 3 0.5": the text and its values; behind them how many were suppressed. */
void fcsl_event_text(const fcsl_machine_t *machine, const fcsl_told_event_t *event, char text[FCSL_EVENT_TEXT_MAX]);
/* "debug", "info", "warning", "error" */
const char *fcsl_severity_name(uint8_t severity);
/* Replaces the events of the next tick's execute of an instance that fcsl_run_substitute replaces, by recorded ones
 * (FCSL_WRITE_EVENTS). */
int fcsl_run_substitute_events(fcsl_run_t *run, uint32_t instance, const void *bytes, uint32_t size,
                               fcsl_error_t *error);

/* ---- times of instances ------------------------------------------------------------------------------------------ */

/* Of one instance of a machine that was built with --times, or of its whole step. From its due time on: connected inputs are
 * copied, execute runs, its health is judged. */
typedef struct {
    uint64_t runs; /* executes so far, faulted ones included */
    uint64_t total_ns;
    uint64_t last_ns; /* of the last run */
    uint64_t max_ns;
} fcsl_time_row_t;

typedef struct {
    const char *name; /* of the instance; "machine": the whole step */
    uint64_t runs;
    uint64_t total_ns;
    uint64_t mean_ns;
    uint64_t p50_ns; /* at most 1/32 too large, as is p99 */
    uint64_t p99_ns;
    uint64_t max_ns;
} fcsl_run_time_t;

/* A row for each instance, in the machine's order, and one for the step, of the same address each time; null where the machine is
 * not measured. Read by the thread that steps. */
const fcsl_time_row_t *fcsl_run_times(const fcsl_run_t *run, uint32_t *size);
/* What is served of the rows: `<instance>.runs` and its like, none writable; null where the machine is not measured. */
const fcsl_field_t *fcsl_run_time_fields(const fcsl_run_t *run, uint32_t *count);
/* Row `index`, from any thread; 0, or -1: there is none. */
int fcsl_run_time(const fcsl_run_t *run, uint32_t index, fcsl_run_time_t *time);

/* ---- views ------------------------------------------------------------------------------------------------------- */

/* What plots and viewers show of this run (docs/reference/language.md): the machine's own views, or those of its host; "" for none. Bags
 * and telemetry carry it. */
const char *fcsl_run_views(const fcsl_run_t *run);
/* Replaces the machine's views: a simulator's name its models, too. Copies the text; at most FCSL_VIEWS_BYTES_MAX bytes. Before
 * recording begins. */
int fcsl_run_set_views(fcsl_run_t *run, const char *views, fcsl_error_t *error);

/* ---- recording -------------------------------------------------------------------------------------------------- */

typedef struct {
    const char *bag; /* directory to create: metadata.yaml and .mcap files, Jazzy's own layout */
    const char *name_space; /* ROS namespace: topics are /<ns>/<machine>/<instance>; "" for none */
    int lossless; /* non-zero: a full ring makes step wait for the writer (simulated time);
                                zero: the record is dropped and counted (real time) */
    /* What is recorded of every tick: the fields that one of these globs matches, separated by commas; `*` stands for any
     * text, `?` for one character. Null: FCSL_RECORD_FIELDS. What reproduces the run, and state, transitions, health and
     * counters are always recorded. */
    const char *fields;
    /* How the bag is split into files and which of them stay, as some of "seconds=60,megabytes=100,files=10,around=30"
     * (docs/guide/recording.md). Null or "": one file. */
    const char *split;
} fcsl_record_options_t;

#define FCSL_RECORD_FIELDS "*.inputs.*,*.outputs.*"

/* Records of this recording that are not in its bag: a record is all that one tick shows, a host write, or a message of an
 * added topic. */
typedef struct {
    uint64_t ring_full; /* the writer was behind; never when lossless */
    uint64_t disk_failed; /* they came after writing had failed */
    /* Checkpoints in the middle of the recording for which the ring had no room: a replay begins at another one. They are no
     * records: nothing that happened is missing. */
    uint64_t keyframes;
} fcsl_record_drops_t;

int fcsl_run_record(fcsl_run_t *run, const fcsl_record_options_t *options, fcsl_error_t *error);
/* Flushes, writes metadata.yaml, closes. Waits for the disk. */
int fcsl_run_record_stop(fcsl_run_t *run, fcsl_error_t *error);
/* The time of the coming records, and the stamp of their messages, in ns: for hosts whose ticks follow another clock, such as
 * ROS time. They call it before each tick. Without it tick k is at k / tick_hz. It lasts beyond the recording. */
void fcsl_run_record_time(fcsl_run_t *run, uint64_t time_ns);
/* `lossless` of what comes from here on; nothing when nothing is being recorded. */
void fcsl_run_record_lossless(fcsl_run_t *run, int lossless);
/* -1 with the reason once writing has failed, 0 otherwise. A lossless recording that failed makes fcsl_run_step fail, too;
 * of the others this is the only word, since a disk that is full must not disturb a tick. Does not wait. */
int fcsl_run_record_check(const fcsl_run_t *run, fcsl_error_t *error);
/* All 0 when nothing is being recorded. */
fcsl_record_drops_t fcsl_run_record_drops(const fcsl_run_t *run);
/* Records alone: ring_full and disk_failed. */
uint64_t fcsl_run_record_dropped(const fcsl_run_t *run);

/* More topics in the same bag (plant truth of a simulator). `schema` is the complete ros2msg text.
 * add_topic returns a topic number, only while recording and before the first step. */
int fcsl_run_record_add_topic(fcsl_run_t *run, const char *topic, const char *type, const char *schema,
                              fcsl_error_t *error);
int fcsl_run_record_write(fcsl_run_t *run, int topic, uint64_t time_ns, const uint8_t *cdr, uint32_t size,
                          fcsl_error_t *error);

/* ---- ROS 2 messages (CDR, little-endian, 4-byte encapsulation header included, padding zeroed) ----------------------- */

/* The instance's generated message of the last completed tick; returns its bytes (the same for every tick), or -1. */
int64_t fcsl_run_message(const fcsl_run_t *run, uint32_t instance, uint8_t *cdr, size_t capacity);

/* What a tick has to show besides, as fcsl_msgs messages. The recorder writes the same bytes. */
typedef enum {
    FCSL_TICK_STATE = 0, /* fcsl_msgs/MachineState */
    FCSL_TICK_TRANSITION = 1, /* fcsl_msgs/TransitionEvent; only of a tick that latched a change of state */
    FCSL_TICK_HEALTH = 2, /* fcsl_msgs/InstanceHealth */
    FCSL_TICK_FAULTS = 3 /* fcsl_msgs/FaultCounters */
} fcsl_tick_message_t;

/* The message of the last completed tick (before the first one: what holds now, as tick 0). Returns its bytes, 0 when there
 * is nothing to say, or -1 when `capacity` is too small. */
int64_t fcsl_run_tick_message(const fcsl_run_t *run, fcsl_tick_message_t what, uint8_t *cdr, size_t capacity);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_RUN_H */
