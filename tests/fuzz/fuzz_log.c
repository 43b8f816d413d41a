/* Whatever is recorded comes back as it was, and whatever part of the log is asked for, only sealed bytes are
 * given.
 *
 * Input: number of records u8, their words u32 as they come, then reads: id u8 (0 list, 1 read, 2 digest),
 * offset u32, length u32. */
#include <string.h>

#include "crc32.h"
#include "log_decoder.h"
#include "rig.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

enum { MOST_RECORDS = 64 };

/* Codes and decodes the records; the decoder is a second one, written from the specification. */
static void coding_loses_nothing(uint32_t (*records)[PROTO_LOG_FIELD_COUNT], size_t count)
{
    struct log_coder coder;
    uint8_t coded[LOG_CODING_MAX_SIZE];
    struct log_decoder decoder;
    memset(&coder, 0, sizeof coder);
    log_decoder_start(&decoder, coded, 0);
    for (size_t i = 0; i < count; i++) {
        uint32_t words[PROTO_LOG_FIELD_COUNT];
        const size_t length = log_coder_encode(&coder, records[i], coded);
        RIG_REQUIRE(length >= 2 && length <= LOG_CODING_MAX_SIZE);
        decoder.at = coded;
        decoder.end = coded + length;
        RIG_REQUIRE(log_decoder_next(&decoder, words) && decoder.at == decoder.end);
        RIG_REQUIRE(memcmp(words, records[i], sizeof words) == 0);
        log_coder_accept(&coder, records[i]);
    }
}

/* A log of these records in the ring, several times over, with a second one after it. */
static void record(uint32_t (*records)[PROTO_LOG_FIELD_COUNT], size_t count)
{
    struct log *const log = &rig.controller.robot.log;
    for (uint16_t id = 1; id <= 2; id++) {
        log_open(log, id, 20, 0, 0);
        for (size_t i = 0; i < 8 * count; i++) {
            struct proto_log_record row;
            proto_log_record_from_words(&row, records[i % count]);
            log_append(log, &row, (uint32_t)i);
        }
        log_close(log, PROTO_LOG_END_FINISHED);
    }
}

static void every_block_decodes(uint32_t rows)
{
    static struct proto_log_record decoded[256];
    const struct log *const log = &rig.controller.robot.log;
    uint32_t found = 0;
    uint8_t block[PROTO_LOG_BLOCK_SIZE];
    for (uint32_t number = log->oldest_block; number < log->end_block; number++) {
        struct proto_log_header header;
        RIG_REQUIRE(log_copy(log, number * PROTO_LOG_BLOCK_SIZE, block, sizeof block));
        RIG_REQUIRE(proto_log_header_decode(&header, block, PROTO_LOG_HEADER_SIZE));
        const int records = log_decoder_block(block, number, header.log_id, decoded, 256);
        RIG_REQUIRE(records >= 0);
        found += (uint32_t)records;
    }
    RIG_REQUIRE(found == rows || log->oldest_block > 0);
}

static void ask_for_range(uint8_t kind, uint32_t offset, uint32_t length)
{
    uint8_t payload[8];
    const uint32_t end = log_end_offset(&rig.controller.robot.log);
    if (kind % 3u == 0) {
        payload[0] = (uint8_t)offset;
        rig_ask(PROTO_ID_LOG_LIST, payload, 1);
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
    static uint32_t records[MOST_RECORDS][PROTO_LOG_FIELD_COUNT];
    struct rig_input input = {.at = data, .left = size};
    const size_t count = 1u + rig_u8(&input) % MOST_RECORDS;
    for (size_t i = 0; i < count; i++) {
        for (size_t field = 0; field < PROTO_LOG_FIELD_COUNT; field++) {
            records[i][field] = rig_u32(&input);
        }
    }
    coding_loses_nothing(records, count);
    rig_power_up();
    record(records, count);
    every_block_decodes((uint32_t)(16 * count));
    for (int i = 0; i < 16 && input.left > 0; i++) {
        const uint8_t kind = rig_u8(&input);
        const uint32_t offset = rig_u32(&input);
        ask_for_range(kind, offset, rig_u32(&input));
    }
    return 0;
}
