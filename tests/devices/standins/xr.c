/* Stands for an OpenXR runtime in tests: XR_MND_headless, the time, a head whose state the test writes. The Khronos loader finds it by
 * XR_RUNTIME_JSON. Layouts and numbers as in the public specification, 64-bit; own code.
 *
 * `standin` and `standin_event` are exported to the test, which lives in the same process. */
#include <stdint.h>
#include <string.h>
#include <time.h>

typedef uint64_t Handle;
typedef struct { float x, y, z; } Vector;
typedef struct { float x, y, z, w; } Quaternion;
typedef struct { uint32_t type; void *next; } Header;
typedef struct { Header header; uint64_t flags; Quaternion orientation; Vector position; } SpaceLocation;
typedef struct { Header header; uint64_t flags; Vector linear, angular; } SpaceVelocity;
typedef struct { Header header; Handle session; uint32_t value; int64_t time; } EventData; /* state changed; the same start has user presence */
typedef struct { Header header; char name[128]; uint32_t version; } ExtensionProperties;
typedef struct { Header header; uint64_t version; char name[128]; } InstanceProperties;
typedef struct { Header header; uint64_t id; uint32_t vendor; char name[256]; uint32_t graphics[3], tracking[2]; } SystemProperties;
typedef struct { Header header; uint32_t kind; Quaternion orientation; Vector position; } ReferenceSpaceCreateInfo;
typedef struct { Header header; uint64_t flags; char application[128]; uint32_t application_version; char engine[128]; uint32_t engine_version;
    uint64_t api; uint32_t layers; const char *const *layer_names; uint32_t extensions; const char *const *names; } InstanceCreateInfo;
typedef struct { uint32_t type, version; size_t size; uint32_t least, most; uint64_t least_api, most_api; } LoaderInfo;
typedef int32_t (*Function)(void);
typedef int32_t (*GetProc)(Handle, const char *, Function *);
typedef struct { uint32_t type, version; size_t size; uint32_t interface; uint64_t api; GetProc get; } RuntimeRequest;

enum { EVENT_UNAVAILABLE = 4, FUNCTION_UNSUPPORTED = -7, EXTENSION_NOT_PRESENT = -9, SIZE_INSUFFICIENT = -11, HANDLE_INVALID = -12,
    SESSION_RUNNING = -14, SESSION_NOT_RUNNING = -16, TIME_INVALID = -30 };
enum { IDLE = 1, READY, SYNCHRONIZED, VISIBLE, FOCUSED, STOPPING };
enum { INSTANCE_LOSS = 17, STATE_CHANGED = 18, SPACE_VELOCITY = 43, USER_PRESENCE = 1000470000 };
enum { VIEW = 1 };

struct {
    Quaternion orientation; Vector position, linear, angular;
    uint64_t location_flags, velocity_flags;
    int32_t create_instance, get_system, create_session, create_space, locate, convert; /* results to order */
    int32_t without_headless, without_presence, asleep;
    int32_t instances, sessions, running, base, wrong; /* wrong: a call that the specification forbids */
    int64_t time;
} standin = {.orientation = {0, 0, 0, 1}, .location_flags = 7, .velocity_flags = 3};

static EventData queue[32];
static unsigned first, last;
void standin_event(uint32_t type, uint32_t value)
{
    EventData event = {{type, 0}, 0x20, value, 1};
    queue[last++ % 32] = event;
}
static int32_t forbidden(int32_t code) { standin.wrong++; return code; }

static int32_t enumerate(const char *layer, uint32_t room, uint32_t *count, ExtensionProperties *found)
{
    const char *names[3] = {"XR_KHR_convert_timespec_time"};
    uint32_t n = 1;
    (void)layer;
    if (!standin.without_headless) names[n++] = "XR_MND_headless";
    if (!standin.without_presence) names[n++] = "XR_EXT_user_presence";
    *count = n;
    if (room && room < n) return SIZE_INSUFFICIENT;
    for (uint32_t i = 0; room && i < n; i++) strcpy(found[i].name, names[i]), found[i].version = 1;
    return 0;
}
static int32_t create_instance(const InstanceCreateInfo *info, Handle *instance)
{
    if (standin.create_instance) return standin.create_instance;
    for (uint32_t i = 0; i < info->extensions; i++) {
        if (standin.without_headless && !strcmp(info->names[i], "XR_MND_headless")) return forbidden(EXTENSION_NOT_PRESENT);
        if (standin.without_presence && !strcmp(info->names[i], "XR_EXT_user_presence")) return forbidden(EXTENSION_NOT_PRESENT);
    }
    *instance = 0x10, first = last = 0, standin.instances++;
    return 0;
}
static int32_t destroy_instance(Handle instance) { (void)instance; standin.instances--; return 0; }
static int32_t instance_properties(Handle instance, InstanceProperties *found)
{
    (void)instance;
    found->version = 1ull << 48;
    strcpy(found->name, "Stand-in");
    return 0;
}
static int32_t get_system(Handle instance, const void *asked, uint64_t *system) { (void)instance, (void)asked; *system = 1; return standin.get_system; }
static int32_t system_properties(Handle instance, uint64_t system, SystemProperties *found)
{
    (void)instance;
    found->id = system;
    strcpy(found->name, "Scripted head");
    return 0;
}
static int32_t create_session(Handle instance, const Header *info, Handle *session)
{
    (void)instance;
    if (info->next) return forbidden(-38); /* a graphics binding */
    if (standin.create_session) return standin.create_session;
    *session = 0x20, standin.sessions++;
    standin_event(STATE_CHANGED, IDLE);
    if (!standin.asleep) standin_event(STATE_CHANGED, READY);
    return 0;
}
static int32_t destroy_session(Handle session) { (void)session; standin.sessions--, standin.running = 0; return 0; }
static int32_t begin_session(Handle session, const void *info)
{
    (void)session, (void)info;
    if (standin.running) return forbidden(SESSION_RUNNING);
    standin.running = 1;
    for (uint32_t state = SYNCHRONIZED; state <= FOCUSED; state++) standin_event(STATE_CHANGED, state);
    return 0;
}
static int32_t end_session(Handle session)
{
    (void)session;
    if (!standin.running) return forbidden(SESSION_NOT_RUNNING);
    standin.running = 0;
    standin_event(STATE_CHANGED, IDLE);
    return 0;
}
static int32_t create_space(Handle session, const ReferenceSpaceCreateInfo *info, Handle *space)
{
    (void)session;
    if (info->orientation.w != 1.0f) return forbidden(-39); /* the pose in the reference space is to be a pose */
    if (info->kind != VIEW) standin.base = (int32_t)info->kind;
    *space = 0x100 + info->kind;
    return standin.create_space;
}
static int32_t destroy_space(Handle space) { (void)space; return 0; }
static int32_t locate(Handle space, Handle base, int64_t time, SpaceLocation *found)
{
    if (space != 0x100 + VIEW || base != 0x100u + (unsigned)standin.base) return forbidden(HANDLE_INVALID);
    if (time <= 0) return forbidden(TIME_INVALID);
    if (standin.locate) return standin.locate;
    standin.time = time;
    found->flags = standin.location_flags, found->orientation = standin.orientation, found->position = standin.position;
    SpaceVelocity *velocity = found->header.next;
    if (velocity && velocity->header.type == SPACE_VELOCITY)
        velocity->flags = standin.velocity_flags, velocity->linear = standin.linear, velocity->angular = standin.angular;
    return 0;
}
static int32_t convert(Handle instance, const struct timespec *t, int64_t *time)
{
    (void)instance;
    *time = t->tv_sec * 1000000000ll + t->tv_nsec;
    return standin.convert;
}
static int32_t poll_event(Handle instance, EventData *event)
{
    (void)instance;
    if (first == last) return EVENT_UNAVAILABLE;
    *event = queue[first++ % 32];
    return 0;
}

static int32_t get_proc(Handle instance, const char *name, Function *found);
static const struct { const char *name; Function function; } FUNCTIONS[] = {
#define ROW(name, function) {name, (Function)(void (*)(void))function}
    ROW("xrGetInstanceProcAddr", get_proc), ROW("xrEnumerateInstanceExtensionProperties", enumerate), ROW("xrCreateInstance", create_instance),
    ROW("xrDestroyInstance", destroy_instance), ROW("xrGetInstanceProperties", instance_properties), ROW("xrPollEvent", poll_event),
    ROW("xrGetSystem", get_system), ROW("xrGetSystemProperties", system_properties), ROW("xrCreateSession", create_session),
    ROW("xrDestroySession", destroy_session), ROW("xrBeginSession", begin_session), ROW("xrEndSession", end_session),
    ROW("xrCreateReferenceSpace", create_space), ROW("xrDestroySpace", destroy_space), ROW("xrLocateSpace", locate),
    ROW("xrConvertTimespecTimeToTimeKHR", convert),
};
static int32_t get_proc(Handle instance, const char *name, Function *found)
{
    (void)instance;
    for (unsigned i = 0; i < sizeof FUNCTIONS / sizeof *FUNCTIONS; i++)
        if (!strcmp(name, FUNCTIONS[i].name)) { *found = FUNCTIONS[i].function; return 0; }
    *found = 0;
    return FUNCTION_UNSUPPORTED;
}
int32_t xrNegotiateLoaderRuntimeInterface(const LoaderInfo *loader, RuntimeRequest *request)
{
    (void)loader;
    request->interface = 1, request->api = 1ull << 48, request->get = get_proc;
    return 0;
}
