/* Stands for LibOVR 1.32 in tests: a head whose state the test writes. 64-bit layouts as in the header's documentation; own code.
 *
 * `standin` below is exported: the test reads and writes it while the "runtime" runs in its process. */
#include <stdint.h>
#include <string.h>

typedef struct { float x, y, z; } Vector;
typedef struct { float x, y, z, w; } Quaternion;
typedef struct { Quaternion orientation; Vector position; } Pose;
typedef struct __attribute__((aligned(8))) { Pose pose; Vector angular, linear, angular_acceleration, linear_acceleration; char pad[4]; double time; } PoseState;
typedef struct __attribute__((aligned(8))) { PoseState head; uint32_t status; PoseState hands[2]; uint32_t hand_status[2]; Pose origin; } TrackingState;
typedef struct { uint32_t flags, minor; void *log; uintptr_t user; uint32_t timeout; char pad[4]; } InitParams;
typedef struct {
    int type; char pad0[4]; char product[64], manufacturer[64]; int16_t vendor, product_id; char serial[24]; int16_t firmware[2];
    uint32_t caps[4]; float fov[16]; int resolution[2]; float rate; char pad1[4];
} HmdDesc;
typedef struct { char visible, present, mounted, lost, quit, recenter, focus, overlay, depth; } Status;
typedef struct { int32_t result; char text[512]; } ErrorInfo;

_Static_assert(sizeof(PoseState) == 88 && sizeof(TrackingState) == 312 && sizeof(InitParams) == 32 && sizeof(HmdDesc) == 264, "layouts of 1.32");
_Static_assert(sizeof(Status) == 9 && sizeof(ErrorInfo) == 516, "layouts of 1.32");

typedef struct {
    PoseState head;
    uint32_t tracked;   /* status flags */
    Status status;
    int32_t initialize, create, session, recenter;   /* results: 0, or an error to order */
    uint32_t flags, minor;                           /* as the client asked */
    int32_t initialized, sessions, recentered, origin;
} Standin;
Standin standin = {.head = {.pose = {.orientation = {0, 0, 0, 1}}}, .tracked = 3, .status = {.present = 1, .mounted = 1}, .origin = -1};

static int32_t last;
static int32_t result(int32_t code) { return last = code; }

int32_t ovr_Initialize(const InitParams *asked)
{
    if (!asked || !(asked->flags & 4)) return result(-1005); /* InvalidParameter: the SDK's loader always sets RequestVersion */
    if (asked->minor > 95) return result(-3002);
    if (standin.initialize) return result(standin.initialize);
    standin.flags = asked->flags, standin.minor = asked->minor, standin.initialized++;
    return result(0);
}
void ovr_Shutdown(void) { standin.initialized--; }
void ovr_GetLastErrorInfo(ErrorInfo *info) { memset(info, 0, sizeof *info); info->result = last; if (last) strcpy(info->text, "as the test ordered"); }
const char *ovr_GetVersionString(void) { return "1.32.0-standin"; }
int32_t ovr_Create(void **session, char *luid)
{
    if (!standin.initialized) return result(-1004);
    if (standin.create) return result(standin.create);
    memset(luid, 0, 8);
    *session = &standin, standin.sessions++;
    return result(0);
}
void ovr_Destroy(void *session) { if (session == &standin) standin.sessions--; }
HmdDesc ovr_GetHmdDesc(void *session)
{
    HmdDesc found = {.type = session ? 14 : 0, .product = "Oculus Rift CV1", .serial = "STANDIN", .resolution = {2160, 1200}, .rate = 90};
    return found;
}
int32_t ovr_GetSessionStatus(void *session, Status *status)
{
    if (session != &standin) return result(-1002);
    *status = standin.status;
    return result(standin.session);
}
int32_t ovr_SetTrackingOriginType(void *session, int origin) { (void)session; standin.origin = origin; return result(origin == 0 || origin == 1 ? 0 : -1005); }
int32_t ovr_RecenterTrackingOrigin(void *session)
{
    (void)session;
    if (standin.recenter) return result(standin.recenter);
    standin.recentered++, standin.status.recenter = 0;
    memset(&standin.head.pose, 0, sizeof standin.head.pose);
    standin.head.pose.orientation.w = 1;
    return result(0);
}
TrackingState ovr_GetTrackingState(void *session, double time, char marker)
{
    TrackingState state;
    memset(&state, 0, sizeof state);
    (void)session, (void)time, (void)marker;
    state.head = standin.head, state.status = standin.tracked, state.origin.orientation.w = 1;
    return state;
}
