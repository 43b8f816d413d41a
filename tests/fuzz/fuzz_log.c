/* Coding is lossless for all records, and reads of any part of the log return sealed bytes only.
 *
 * Input: number of records u8, their words u32 as they come, geometry and rate u8, first record u32, then
 * reads: id u8 (0 list, 1 read, 2 digest), offset u32, length u32. */
#include <string.h>

#include "crc32.h"
#include "log_decoder.h"
#include "rig.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

enum { MAX_RECORDS = 64 };

/* What the parameters' limits allow. */
static const float metres[] = {3.14e-8f, 0.00016624259f, 0.0062f, 1.5707964f};
static const float turns[] = {1.0e-9f, 9.3492346e-05f, 0.01f, 12.5f};

/* Codes and decodes the records; the decoder is a second one, written from the specification. */
static void coding_loses_nothing(uint32_t (*records)[PROTO_LOG_FIELD_COUNT], size_t count,
                                 const struct log_format *format, uint32_t first)
{
    static struct log_coder coder;
    static uint8_t coded[MAX_RECORDS * LOG_CODING_MAX];
    static struct log_decoder decoder;
    log_coder_start(&coder, format, first, coded, sizeof coded);
    for (size_t i = 0; i < count; i++) {
        struct proto_log_record row;
        proto_log_record_from_words(&row, records[i]);
        const size_t before = log_coder_size(&coder);
        log_coder_add(&coder, &row);
        RIG_REQUIRE(log_coder_size(&coder) - before <= (size_t)LOG_CODING_MAX);
    }
    log_decoder_start(&decoder, format->geometry.metres_per_count, format->geometry.turns_per_count,
                      format->rate_hz, first, coded, log_coder_finish(&coder));
    for (size_t i = 0; i < count; i++) {
        struct proto_log_record row;
        uint32_t expected[PROTO_LOG_FIELD_COUNT];
        uint32_t words[PROTO_LOG_FIELD_COUNT];
        proto_log_record_from_words(&row, records[i]);
        proto_log_record_to_words(&row, expected);
        log_decoder_next(&decoder, words);
        RIG_REQUIRE(memcmp(words, expected, sizeof words) == 0);
    }
}

/* A log of these records in the ring, several times over, with a second one after it. */
static void record(uint32_t (*records)[PROTO_LOG_FIELD_COUNT], size_t count, const struct log_format *format)
{
    struct log *const log = &rig.controller.robot.log;
    for (uint16_t id = 1; id <= 2; id++) {
        const struct log_opening opening = {.log_id = id, .format = *format};
        log_open(log, &opening);
        for (size_t i = 0; i < 8 * count; i++) {
            struct proto_log_record row;
            proto_log_record_from_words(&row, records[i % count]);
            log_append(log, &row);
        }
        log_close(log, PROTO_LOG_END_FINISHED);
    }
}

static void every_block_decodes(uint32_t rows)
{
    static struct proto_log_record decoded[16 * MAX_RECORDS];
    const struct log *const log = &rig.controller.robot.log;
    uint32_t found = 0;
    uint8_t block[PROTO_LOG_BLOCK_LIMIT];
    for (uint32_t cell = log->oldest_cell; cell < log->end_cell;) {
        struct proto_log_header header;
        const uint32_t left = (log->end_cell - cell) * PROTO_LOG_CELL_SIZE;
        log_copy(log, cell * PROTO_LOG_CELL_SIZE, block, left < sizeof block ? left : sizeof block);
        RIG_REQUIRE(proto_log_header_decode(&header, block, PROTO_LOG_HEADER_SIZE));
        const int records = log_decoder_block(block, cell, header.log_id, decoded, 16 * MAX_RECORDS);
        RIG_REQUIRE(records >= 0);
        found += (uint32_t)records;
        cell += log_decoder_span(block) / PROTO_LOG_CELL_SIZE;
    }
    RIG_REQUIRE(found == rows || log->oldest_cell > 0);
}

static void ask_for_range(uint8_t kind, uint32_t offset, uint32_t length)
{
    uint8_t payload[8];
    const uint32_t end = log_end_offset(&rig.controller.robot.log);
    if (kind % 3u == 0) {
        const struct proto_log_list_request request = {.first = (uint16_t)offset};
        rig_ask(PROTO_ID_LOG_LIST, payload, proto_log_list_request_encode(&request, payload, sizeof payload));
        RIG_REQUIRE(rig.accepted);
    } else if (kind % 3u == 1) {
        const struct proto_log_read_request request = {.offset = offset, .length = (uint16_t)length};
        rig_ask(PROTO_ID_LOG_READ, payload, proto_log_read_request_encode(&request, payload, sizeof payload));
        struct proto_log_read_reply reply;
        if (rig.accepted) {
            RIG_REQUIRE(proto_log_read_reply_decode(&reply, rig.reply.payload, rig.reply.payload_length));
            RIG_REQUIRE(reply.offset == offset && offset < end && reply.data_length <= end - offset);
        }
    } else {
        const struct proto_log_digest_request request = {.offset = offset, .length = length};
        rig_ask(PROTO_ID_LOG_DIGEST, payload,
                proto_log_digest_request_encode(&request, payload, sizeof payload));
        RIG_REQUIRE(!rig.accepted || (offset < end && length <= end - offset));
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static uint32_t records[MAX_RECORDS][PROTO_LOG_FIELD_COUNT];
    struct rig_input input = {.at = data, .left = size};
    const size_t count = 1u + rig_u8(&input) % MAX_RECORDS;
    for (size_t i = 0; i < count; i++) {
        for (size_t field = 0; field < PROTO_LOG_FIELD_COUNT; field++) {
            records[i][field] = rig_u32(&input);
        }
    }
    const uint8_t choice = rig_u8(&input);
    const struct log_format format = {
        .geometry = {metres[choice % 4u], turns[choice / 4u % 4u]},
        .rate_hz = (uint16_t)(1u + choice % 200u),
    };
    coding_loses_nothing(records, count, &format, rig_u32(&input));
    rig_power_up();
    record(records, count, &format);
    every_block_decodes((uint32_t)(16 * count));
    for (int i = 0; i < 16 && input.left > 0; i++) {
        const uint8_t kind = rig_u8(&input);
        const uint32_t offset = rig_u32(&input);
        ask_for_range(kind, offset, rig_u32(&input));
    }
    return 0;
}
