/* Stands for libHD, the library behind OpenHaptics' HDAPI: two styluses, each held by a simulated hand (a mass on a spring and a damper
 * towards a scripted place). Own code; names, values and layouts are those of HDAPI's public reference.
 *
 * TROCAR_STANDIN_HD names a file that holds `World`: orders to the devices, which outlive the processes that use them, and a log with a row
 * for every device and tick. Without it the world is private and everything works. hd.py is the other side of the file.
 */
#include <fcntl.h>
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

typedef unsigned int HDenum, HDerror, HHD;
typedef unsigned char HDboolean;
typedef unsigned long HDulong;
typedef unsigned short HDushort;
typedef struct {
    HDerror errorCode;
    int internalErrorCode;
    HHD hHD;
} HDErrorInfo;
typedef unsigned int (*HDSchedulerCallback)(void *);

enum { DEVICES = 2, CALLBACKS = 8, ERRORS = 64, ROWS = 120000, COLUMNS = 12 };
enum { OK = 0x5000, NEEDS_UPDATE = 0x5001, NEEDS_MANUAL_INPUT = 0x5002, INKWELL = 4 };
static const HHD INVALID_HANDLE = 0xFFFFFFFFu;

typedef struct {
    char name[64];
    int64_t plugged, calibration, calibration_at_power_on, styles, inkwell, safety_switch, buttons;
    int64_t silent;      /* a process that does not own the device sees the placeholder pose; else it gets HD_TIMER_ERROR */
    int64_t placeholder; /* the owner sees it too */
    int64_t error;       /* pushed at the end of each of the next `error_frames` frames */
    int64_t error_frames;
    int64_t owner; /* process that has the device */
    int64_t force_output;
    int64_t updates, last_style; /* calls of hdUpdateCalibration that were granted */
    int64_t blocked;             /* as long as it is 1, hdBeginFrame does not return; 2: hdEndFrame, with the force sent */
    double motors[3];            /* force that the hand gets, N */
    double target[3], amplitude[3], frequency, turn_amplitude;
    double mass, stiffness, damping; /* of the hand */
    double max_force, max_continuous_force, max_stiffness, max_damping; /* N, N, N/mm, N s/mm */
    double position[3], velocity[3];                                    /* m, m/s, axes of HDAPI */
} Device;

typedef struct {
    int64_t logged;
    Device device[DEVICES];
    double row[ROWS][COLUMNS]; /* time, device, callback s, gap s, force, position, late s, 0 */
} World;

typedef struct {
    int open, framed, done;
    double set[3], out[3];
} Handle;

static World *world;
static Handle handles[DEVICES];
static HHD current = 0xFFFFFFFFu;
static struct {
    HDSchedulerCallback call;
    void *data;
    unsigned long handle;
    int live;
} callbacks[CALLBACKS];
static unsigned long next_callback; /* the first schedule is 0: no documentation says that it is not */
static pthread_t thread;
static volatile int running;
static unsigned long rate = 1000;
static HDErrorInfo errors[ERRORS];
static int error_count;
static double tick_start, instantaneous_rate;

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void make_world(World *w) {
    for (int i = 0; i < DEVICES; i++) {
        Device *d = &w->device[i];
        snprintf(d->name, sizeof d->name, "%s", i ? "left" : "Default Device");
        d->plugged = 1, d->calibration = d->calibration_at_power_on = NEEDS_UPDATE, d->styles = INKWELL, d->safety_switch = 1;
        d->mass = 0.15, d->stiffness = 200, d->damping = 4;
        d->max_force = 3.3, d->max_continuous_force = 0.88, d->max_stiffness = 1.0, d->max_damping = 0.005;
    }
}

__attribute__((constructor)) static void open_world(void) {
    const char *path = getenv("TROCAR_STANDIN_HD");
    int file = path ? open(path, O_RDWR) : -1;
    void *shared = file < 0 ? MAP_FAILED : mmap(0, sizeof(World), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    if (shared != MAP_FAILED) {
        world = shared;
        return;
    }
    world = calloc(1, sizeof(World));
    make_world(world);
}

/* For hd.py: the size of the file, and what it holds at first. */
long standin_size(void) { return (long)sizeof(World); }
void standin_make(void *memory) { make_world(memory); }

static void push(HDerror code, HHD handle) {
    if (error_count < ERRORS) errors[error_count++] = (HDErrorInfo){code, 0, handle};
}

static Handle *opened(HHD handle) {
    if (handle < DEVICES && handles[handle].open) return &handles[handle];
    push(0x0104, handle);
    return 0;
}

/* Whether this process has the device; takes it if nobody living has it. */
static int owns(Device *d) {
    if (d->owner != getpid() && (d->owner == 0 || kill((pid_t)d->owner, 0) != 0)) d->owner = getpid();
    return d->owner == getpid();
}

static int pretends(Device *d) { return d->placeholder || !owns(d); }

HHD hdInitDevice(const char *name) {
    for (HHD i = 0; i < DEVICES; i++) {
        Device *d = &world->device[i];
        if (name ? strcmp(name, d->name) != 0 : i != 0) continue;
        if (!d->plugged || handles[i].open) {
            push(d->plugged ? 0x0301 : 0x0302, INVALID_HANDLE);
            return INVALID_HANDLE;
        }
        memset(&handles[i], 0, sizeof handles[i]);
        handles[i].open = 1;
        owns(d);
        return current = i;
    }
    push(0x0300, INVALID_HANDLE);
    return INVALID_HANDLE;
}

void hdDisableDevice(HHD handle) {
    Handle *h = opened(handle);
    if (!h) return;
    h->open = 0;
    if (world->device[handle].owner == getpid()) world->device[handle].owner = 0, world->device[handle].force_output = 0;
}

void hdMakeCurrentDevice(HHD handle) { current = handle; }
HHD hdGetCurrentDevice(void) { return current; }

static void block(const Device *d, int64_t where) {
    while (((const volatile Device *)d)->blocked == where) usleep(1000);
}

void hdBeginFrame(HHD handle) {
    Handle *h = opened(current = handle);
    if (!h) return;
    block(&world->device[handle], 1);
    if (h->framed || h->done) {
        push(0x0400, handle);
        return;
    }
    h->framed = 1;
    memset(h->set, 0, sizeof h->set);
}

void hdEndFrame(HHD handle) {
    Handle *h = opened(current = handle);
    if (!h) return;
    Device *d = &world->device[handle];
    if (!h->framed) {
        push(0x0401, handle);
        return;
    }
    h->framed = 0, h->done = 1;
    double norm = sqrt(h->set[0] * h->set[0] + h->set[1] * h->set[1] + h->set[2] * h->set[2]);
    if (norm > d->max_force) {
        push(0x0201, handle);
        memset(h->set, 0, sizeof h->set);
    }
    memcpy(h->out, h->set, sizeof h->out);
    for (int i = 0; i < 3; i++) d->motors[i] = d->force_output ? h->out[i] : 0;
    if (!d->plugged) push(0x0302, handle);
    else if (!owns(d) && !d->silent) push(0x0304, handle);
    if (d->error_frames > 0) d->error_frames--, push((HDerror)d->error, handle);
    block(d, 2);
}

HDErrorInfo hdGetError(void) {
    if (error_count > 0) return errors[--error_count];
    return (HDErrorInfo){0, 0, INVALID_HANDLE};
}

const char *hdGetErrorString(HDerror code) {
    static char text[32];
    snprintf(text, sizeof text, "stand-in error 0x%04x", code);
    return text;
}

static void capability(HDenum what, int on) {
    if (!opened(current)) return;
    if (what == 0x4000) world->device[current].force_output = on;
    else if (what < 0x4000 || what > 0x4004) push(0x0100, current);
}

void hdEnable(HDenum what) { capability(what, 1); }
void hdDisable(HDenum what) { capability(what, 0); }
HDboolean hdIsEnabled(HDenum what) { return opened(current) && what == 0x4000 ? (HDboolean)world->device[current].force_output : 0; }

void hdGetDoublev(HDenum what, double *out) {
    if (!opened(current)) return;
    Device *d = &world->device[current];
    double p[3] = {d->position[0] * 1e3, d->position[1] * 1e3, d->position[2] * 1e3};
    double v[3] = {d->velocity[0] * 1e3, d->velocity[1] * 1e3, d->velocity[2] * 1e3};
    double angle = d->turn_amplitude * sin(2 * M_PI * d->frequency * tick_start), c = cos(angle), s = sin(angle);
    if (pretends(d)) p[0] = 0, p[1] = -110, p[2] = -35, v[0] = v[1] = v[2] = 0, c = 1, s = 0;
    double transform[16] = {c, 0, -s, 0, 0, 1, 0, 0, s, 0, c, 0, p[0], p[1], p[2], 1};
    double joints[3] = {0.1, 0.2, 0.3};
    if (pretends(d)) memset(joints, 0, sizeof joints);
    switch (what) {
    case 0x2050: memcpy(out, p, sizeof p); break;
    case 0x2051: memcpy(out, v, sizeof v); break;
    case 0x2052: memcpy(out, transform, sizeof transform); break;
    case 0x2100: memcpy(out, joints, sizeof joints); break;
    case 0x2150: memset(out, 0, 24); break;
    case 0x2602: *out = d->max_stiffness; break;
    case 0x2603: *out = d->max_force; break;
    case 0x2604: *out = d->max_continuous_force; break;
    case 0x2609: *out = d->max_damping; break;
    case 0x2700: memcpy(out, handles[current].set, 24); break;
    default: push(0x0100, current);
    }
}

void hdSetDoublev(HDenum what, const double *in) {
    Handle *h = opened(current);
    if (!h) return;
    if (!h->framed) push(0x0402, current);
    else if (what != 0x2700) push(0x0100, current);
    else memcpy(h->set, in, sizeof h->set);
}

void hdGetIntegerv(HDenum what, int *out) {
    if (!opened(current)) return;
    Device *d = &world->device[current];
    switch (what) {
    case 0x2000: *out = pretends(d) ? 0 : (int)d->buttons; break;
    case 0x2553: *out = 6; break;
    case 0x2554: *out = 3; break;
    case 0x2555: *out = (int)d->styles; break;
    case 0x2600: *out = (int)rate; break;
    case 0x2601: *out = (int)instantaneous_rate; break;
    default: push(0x0100, current);
    }
}

void hdGetBooleanv(HDenum what, HDboolean *out) {
    if (!opened(current)) return;
    Device *d = &world->device[current];
    if (what == 0x2001) *out = (HDboolean)d->safety_switch;
    else if (what == 0x2002) *out = (HDboolean)d->inkwell;
    else push(0x0100, current);
}

const char *hdGetString(HDenum what) {
    static char serial[16];
    if (!opened(current)) return "";
    snprintf(serial, sizeof serial, "STANDIN-%u", current);
    switch (what) {
    case 0x2500: return "3.50.0";
    case 0x2501: return "Touch";
    case 0x2502: return "2019.2.15";
    case 0x2503: return "stand-in";
    case 0x2504: return serial;
    default: push(0x0100, current); return "";
    }
}

HDenum hdCheckCalibration(void) { return opened(current) ? (HDenum)world->device[current].calibration : NEEDS_UPDATE; }

void hdUpdateCalibration(HDenum style) {
    if (!opened(current)) return;
    Device *d = &world->device[current];
    if (!(style & (HDenum)d->styles) || d->calibration != NEEDS_UPDATE) push(0x0102, current);
    else d->calibration = OK, d->updates++, d->last_style = style;
}

void hdSetSchedulerRate(HDulong hertz) {
    if (hertz == 500 || hertz == 1000 || hertz == 2000) rate = hertz;
    else push(0x0101, current);
}

/* What happens to a device while nobody looks: it loses its calibration without power, and finds it in the inkwell. */
static void attend(Device *d) {
    if (!d->plugged) d->calibration = d->calibration_at_power_on, d->owner = 0;
    else if (d->calibration == NEEDS_MANUAL_INPUT && d->inkwell) d->calibration = NEEDS_UPDATE;
}

/* Move the hands on by `elapsed` under the force that the motors give. */
static void move(double elapsed, double time) {
    int parts = 1 + (int)(elapsed / 0.0005);
    for (int k = 0; k < DEVICES; k++) {
        Device *d = &world->device[k];
        attend(d);
        if (!handles[k].open || !owns(d)) continue;
        handles[k].done = 0;
        double sway = sin(2 * M_PI * d->frequency * time), dt = elapsed / parts;
        for (int j = 0; j < parts; j++)
            for (int i = 0; i < 3; i++) {
                double motor = d->force_output && d->plugged ? handles[k].out[i] : 0;
                double force = d->stiffness * (d->target[i] + d->amplitude[i] * sway - d->position[i]) - d->damping * d->velocity[i] + motor;
                d->velocity[i] += force / d->mass * dt;
                d->position[i] += d->velocity[i] * dt;
            }
    }
    for (int k = 0; k < DEVICES; k++) handles[k].done = 0;
}

static void log_tick(double time, double gap, double callback, double late) {
    for (int k = 0; k < DEVICES; k++) {
        Device *d = &world->device[k];
        if (!handles[k].open || d->owner != getpid() || world->logged >= ROWS) continue;
        double on = d->force_output && d->plugged ? 1 : 0, *out = handles[k].out, *p = d->position;
        double row[COLUMNS] = {time, k, callback, gap, on * out[0], on * out[1], on * out[2], p[0], p[1], p[2], late, 0};
        memcpy(world->row[world->logged], row, sizeof row);
        world->logged++;
    }
}

/* For tests that are their own scheduler: use the world at `memory`, and let time go on by `elapsed` without calling anybody. */
void standin_use(void *memory) {
    world = memory;
    memset(handles, 0, sizeof handles);
    error_count = 0;
}
void standin_tick(double elapsed) {
    tick_start += elapsed;
    move(elapsed, tick_start);
}

static void *schedule(void *unused) {
    (void)unused;
    double period = 1.0 / (double)rate, next = now(), last = next;
    while (running) {
        double time = now(), gap = time - last;
        instantaneous_rate = 1.0 / (gap + 1e-12), tick_start = time;
        move(gap < 0.05 ? gap : 0.05, time);
        double begun = now();
        for (int i = 0; i < CALLBACKS; i++)
            if (callbacks[i].live && callbacks[i].call(callbacks[i].data) == 0) callbacks[i].live = 0;
        log_tick(time, gap, now() - begun, time - next);
        last = time, next += period;
        double end = now();
        if (end > next + period) next = end; /* missed ticks are gone */
        struct timespec until = {(time_t)next, (long)((next - floor(next)) * 1e9)};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, 0);
    }
    return 0;
}

void hdStartScheduler(void) {
    if (running) return;
    running = 1;
    if (pthread_create(&thread, 0, schedule, 0)) running = 0, push(0x0304, current);
}

void hdStopScheduler(void) {
    if (!running) return;
    running = 0;
    pthread_join(thread, 0);
}

unsigned long hdScheduleAsynchronous(HDSchedulerCallback call, void *data, HDushort priority) {
    (void)priority;
    for (int i = 0; i < CALLBACKS; i++) {
        if (callbacks[i].live) continue;
        callbacks[i].call = call, callbacks[i].data = data, callbacks[i].handle = next_callback, callbacks[i].live = 1;
        return next_callback++;
    }
    push(0x0501, current);
    return 0;
}

void hdUnschedule(unsigned long handle) {
    for (int i = 0; i < CALLBACKS; i++)
        if (callbacks[i].handle == handle) callbacks[i].live = 0;
}

HDboolean hdWaitForCompletion(unsigned long handle, HDenum code) {
    (void)code;
    for (int i = 0; i < CALLBACKS; i++)
        if (callbacks[i].handle == handle && callbacks[i].live) return 1;
    return 0;
}
