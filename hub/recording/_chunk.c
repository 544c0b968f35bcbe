/* The records of a chunk, byte for byte as hub/recording/chunk.py has them made by numpy.

A recorder shares the interpreter with the step loop: here it needs it only while it looks up where the bytes of each
message are. Without this module all is the same, and a session waits longer for its recorder.
*/

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <stdint.h>
#include <string.h>

#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "MCAP is little-endian: the Python code is used here"
#endif

/* https://mcap.dev/spec#message-op0x05: where its fields are, and how long it is without its payload. */
enum { OPCODE = 0, LENGTH = 1, CHANNEL = 9, SEQUENCE = 11, LOG_TIME = 15, PUBLISH_TIME = 23, HEAD = 31 };
static const char MESSAGE = 0x05;
/* https://mcap.dev/spec#message-index-op0x07: opcode and length, channel, bytes of the entries; an entry has two i64 */
enum { INDEX_LENGTH = 1, INDEX_CHANNEL = 9, INDEX_BYTES = 11, INDEX_HEAD = 15, INDEX_ENTRY = 16, CHANNELS = 1 << 16 };
static const char MESSAGE_INDEX = 0x07;
static const int64_t SECOND_NS = 1000000000;

/* One entry of the queue: a message of a channel, or the vectors of a block. */
typedef struct {
    int64_t number, time_ns;
    const char *content;
    Py_ssize_t size;
} Entry;

/* What hub/recording/vector_block.py says of a block. */
typedef struct {
    const char *template_;
    Py_ssize_t size, vector_bytes, times, stamps, spans, messages;
    const int64_t *time, *stamp; /* where each is in the records */
    const int64_t (*span)[3];    /* where a part of the vectors is in the records, where in the vectors, and its bytes */
    const int64_t (*message)[2]; /* channel, and where its message is in the records */
} Block;

static int block_of(PyObject *layout, Block *block)
{
    const char *time, *stamp, *span, *message;
    if (!PyArg_ParseTuple(layout, "y#ny#y#y#y#", &block->template_, &block->size, &block->vector_bytes, &time,
                          &block->times, &stamp, &block->stamps, &span, &block->spans, &message, &block->messages))
        return 0;
    block->time = (const int64_t *)time, block->times /= sizeof *block->time;
    block->stamp = (const int64_t *)stamp, block->stamps /= sizeof *block->stamp;
    block->span = (const int64_t(*)[3])span, block->spans /= sizeof *block->span;
    block->message = (const int64_t(*)[2])message, block->messages /= sizeof *block->message;
    return 1;
}

static int entry_of(PyObject *queued, Entry *entry)
{
    if (!PyTuple_Check(queued) || PyTuple_GET_SIZE(queued) != 3 || !PyBytes_Check(PyTuple_GET_ITEM(queued, 2))) {
        PyErr_SetString(PyExc_TypeError, "an entry of the queue is (number, time in ns, bytes)");
        return 0;
    }
    entry->number = PyLong_AsLongLong(PyTuple_GET_ITEM(queued, 0));
    entry->time_ns = PyLong_AsLongLong(PyTuple_GET_ITEM(queued, 1));
    entry->content = PyBytes_AS_STRING(PyTuple_GET_ITEM(queued, 2));
    entry->size = PyBytes_GET_SIZE(PyTuple_GET_ITEM(queued, 2));
    if (!PyErr_Occurred() && (entry->number < 0 || entry->time_ns < 0))
        PyErr_Format(PyExc_OverflowError, "entry %lld at %lld ns: neither may be negative", (long long)entry->number,
                     (long long)entry->time_ns);
    return !PyErr_Occurred();
}

static char *put_message(char *to, const Entry *entry)
{
    uint64_t length = HEAD - CHANNEL + entry->size;
    uint16_t channel = (uint16_t)entry->number;
    to[OPCODE] = MESSAGE;
    memcpy(to + LENGTH, &length, sizeof length);
    memcpy(to + CHANNEL, &channel, sizeof channel);
    memset(to + SEQUENCE, 0, LOG_TIME - SEQUENCE);
    memcpy(to + LOG_TIME, &entry->time_ns, sizeof entry->time_ns);
    memcpy(to + PUBLISH_TIME, &entry->time_ns, sizeof entry->time_ns);
    memcpy(to + HEAD, entry->content, entry->size);
    return to + HEAD + entry->size;
}

static char *put_vectors(char *to, const Entry *entry, const Block *block)
{
    uint32_t stamp[2] = {(uint32_t)(entry->time_ns / SECOND_NS), (uint32_t)(entry->time_ns % SECOND_NS)};
    memcpy(to, block->template_, block->size);
    for (Py_ssize_t i = 0; i < block->times; i++)
        memcpy(to + block->time[i], &entry->time_ns, sizeof entry->time_ns);
    for (Py_ssize_t i = 0; i < block->stamps; i++)
        memcpy(to + block->stamp[i], stamp, sizeof stamp);
    for (Py_ssize_t i = 0; i < block->spans; i++)
        memcpy(to + block->span[i][0], entry->content + block->span[i][1], block->span[i][2]);
    return to + block->size;
}

/* Fill the records; and channels, times and offsets of the messages, one after the other. */
static void fill(const Entry *entries, Py_ssize_t count, const Block *blocks, int64_t first_block, char *records,
                 int64_t *channels, Py_ssize_t messages)
{
    int64_t *times = channels + messages, *offsets = times + messages;
    char *to = records;
    for (const Entry *entry = entries; entry < entries + count; entry++) {
        int64_t start = to - records;
        if (entry->number < first_block) {
            *channels++ = entry->number, *times++ = entry->time_ns, *offsets++ = start;
            to = put_message(to, entry);
            continue;
        }
        const Block *block = blocks + (entry->number - first_block);
        for (Py_ssize_t i = 0; i < block->messages; i++) {
            *channels++ = block->message[i][0], *times++ = entry->time_ns;
            *offsets++ = start + block->message[i][1];
        }
        to = put_vectors(to, entry, block);
    }
}

/* Find blocks and entries; return 0, with an error, if one is none. Add up bytes and messages. */
static int find(PyObject *queued, PyObject *layouts, int64_t first_block, Entry *entries, Block *blocks,
                Py_ssize_t *size, Py_ssize_t *messages)
{
    Py_ssize_t known = PyList_GET_SIZE(layouts);
    for (Py_ssize_t i = 0; i < known; i++)
        if (!block_of(PyList_GET_ITEM(layouts, i), blocks + i))
            return 0;
    for (Py_ssize_t i = 0; i < PyList_GET_SIZE(queued); i++) {
        if (!entry_of(PyList_GET_ITEM(queued, i), entries + i))
            return 0;
        int64_t of_block = entries[i].number - first_block;
        if (of_block < 0) {
            *size += HEAD + entries[i].size, *messages += 1;
            continue;
        }
        if (of_block >= known || entries[i].size != blocks[of_block].vector_bytes) {
            PyErr_Format(PyExc_ValueError, "%zd bytes are no vectors of block %lld", entries[i].size,
                         (long long)of_block);
            return 0;
        }
        *size += blocks[of_block].size, *messages += blocks[of_block].messages;
    }
    return 1;
}

static PyObject *lay_out(PyObject *module, PyObject *args)
{
    (void)module;
    PyObject *queued, *layouts, *records = NULL, *places = NULL, *made = NULL;
    long long first_block;
    Py_ssize_t size = 0, messages = 0;
    if (!PyArg_ParseTuple(args, "O!O!L", &PyList_Type, &queued, &PyList_Type, &layouts, &first_block))
        return NULL;
    Py_ssize_t count = PyList_GET_SIZE(queued);
    Entry *entries = PyMem_New(Entry, count + 1);
    Block *blocks = PyMem_New(Block, PyList_GET_SIZE(layouts) + 1);
    if (entries == NULL || blocks == NULL)
        PyErr_NoMemory();
    else if (find(queued, layouts, first_block, entries, blocks, &size, &messages) &&
             (records = PyBytes_FromStringAndSize(NULL, size)) != NULL &&
             (places = PyBytes_FromStringAndSize(NULL, 3 * messages * (Py_ssize_t)sizeof(int64_t))) != NULL) {
        char *to = PyBytes_AS_STRING(records);
        int64_t *channels = (int64_t *)PyBytes_AS_STRING(places);
        Py_BEGIN_ALLOW_THREADS /* the caller keeps queue and layouts, and does not change them */
        fill(entries, count, blocks, first_block, to, channels, messages);
        Py_END_ALLOW_THREADS
        made = PyTuple_Pack(2, records, places);
    }
    Py_XDECREF(records);
    Py_XDECREF(places);
    PyMem_Free(entries);
    PyMem_Free(blocks);
    return made;
}

/* Count the messages of each channel; return the number of channels with any, or -1 if one is none. */
static Py_ssize_t count_messages(const int64_t *channels, Py_ssize_t messages, Py_ssize_t *counts)
{
    Py_ssize_t found = 0;
    for (Py_ssize_t i = 0; i < messages; i++) {
        if (channels[i] < 0 || channels[i] >= CHANNELS)
            return -1;
        found += !counts[channels[i]]++;
    }
    return found;
}

/* Write what is in front of each channel's entries; fill the tables of channels, counts and places of the records. */
static void put_heads(char *records, const Py_ssize_t *counts, char **next, Py_ssize_t found, int64_t *table)
{
    char *to = records;
    for (Py_ssize_t channel = 0, i = 0; i < found; channel++) {
        if (!counts[channel])
            continue;
        uint32_t bytes = (uint32_t)(counts[channel] * INDEX_ENTRY);
        uint64_t length = INDEX_HEAD - INDEX_CHANNEL + (uint64_t)bytes;
        uint16_t number = (uint16_t)channel;
        to[OPCODE] = MESSAGE_INDEX;
        memcpy(to + INDEX_LENGTH, &length, sizeof length);
        memcpy(to + INDEX_CHANNEL, &number, sizeof number);
        memcpy(to + INDEX_BYTES, &bytes, sizeof bytes);
        table[i] = channel, table[found + i] = counts[channel], table[2 * found + i] = to - records;
        next[channel] = to + INDEX_HEAD;
        to += INDEX_HEAD + bytes;
        i++;
    }
}

static PyObject *indexed(const int64_t *channels, const int64_t *times, const int64_t *offsets, Py_ssize_t messages,
                         Py_ssize_t *counts, char **next)
{
    Py_ssize_t found = count_messages(channels, messages, counts);
    if (found < 0) {
        PyErr_SetString(PyExc_ValueError, "the number of a channel has 16 bits");
        return NULL;
    }
    PyObject *records = PyBytes_FromStringAndSize(NULL, found * INDEX_HEAD + messages * INDEX_ENTRY);
    PyObject *tables = PyBytes_FromStringAndSize(NULL, 3 * found * (Py_ssize_t)sizeof(int64_t)), *made = NULL;
    if (records != NULL && tables != NULL) {
        put_heads(PyBytes_AS_STRING(records), counts, next, found, (int64_t *)PyBytes_AS_STRING(tables));
        for (Py_ssize_t i = 0; i < messages; i++) {
            char **to = next + channels[i];
            memcpy(*to, times + i, sizeof *times);
            memcpy(*to + sizeof *times, offsets + i, sizeof *offsets);
            *to += INDEX_ENTRY;
        }
        made = PyTuple_Pack(2, records, tables);
    }
    Py_XDECREF(records);
    Py_XDECREF(tables);
    return made;
}

static PyObject *index_(PyObject *module, PyObject *args)
{
    (void)module;
    Py_buffer channels, times, offsets;
    PyObject *made = NULL;
    if (!PyArg_ParseTuple(args, "y*y*y*", &channels, &times, &offsets))
        return NULL;
    Py_ssize_t *counts = PyMem_Calloc(CHANNELS, sizeof *counts);
    char **next = PyMem_New(char *, CHANNELS);
    if (counts == NULL || next == NULL)
        PyErr_NoMemory();
    else if (times.len != channels.len || offsets.len != channels.len)
        PyErr_SetString(PyExc_ValueError, "channels, times and offsets are those of the same messages");
    else
        made = indexed(channels.buf, times.buf, offsets.buf, channels.len / (Py_ssize_t)sizeof(int64_t), counts, next);
    PyMem_Free(counts);
    PyMem_Free(next);
    PyBuffer_Release(&channels);
    PyBuffer_Release(&times);
    PyBuffer_Release(&offsets);
    return made;
}

static PyMethodDef METHODS[] = {
    {"lay_out", lay_out, METH_VARARGS, "Return the records of a queue, and channels, times and offsets (i64)."},
    {"index", index_, METH_VARARGS, "Return the message indexes of a chunk, and channels, counts and places (i64)."},
    {NULL, NULL, 0, NULL}};
static PyModuleDef MODULE = {PyModuleDef_HEAD_INIT, "_chunk", NULL, -1, METHODS, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__chunk(void) { return PyModule_Create(&MODULE); }
