/* SPDX-License-Identifier: Apache-2.0
 *
 * The command server's JSON: what it takes, what it refuses, floats that round-trip. The sources are compiled in.
 */
#include "vars/json_parse.c"
#include "vars/json_read.c"
#include "vars/json_write.c"

#include <inttypes.h>
#include <stdlib.h>

#include "vars/base64.c"
#include "fcsl_check.h"

enum { TOKENS = 64 };

static json_token_t tokens[TOKENS];
static json_t json;

static const char *parse(const char *text)
{
    return fcsl_json_parse(text, strlen(text), tokens, TOKENS, &json);
}

static void test_accepted(void)
{
    static const char *const texts[] = {"0",
                                        "-0.5e+3",
                                        "\"\"",
                                        "[]",
                                        "{}",
                                        " [ 1 , 2 ] ",
                                        "{\"a\":{\"b\":[true,false,null]}}",
                                        "\"\\u00e9\\n\\\"\"",
                                        "\"\xc3\xa9\"",
                                        "[[[[[[[[[[[[[[[1]]]]]]]]]]]]]]]"};
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
        CHECK(parse(texts[i]) == NULL);
    }
}

static void test_refused(void)
{
    static const char *const texts[] = {
        "",
        " ",
        "{",
        "}",
        "[1,]",
        "[1 2]",
        "{\"a\"}",
        "{\"a\":}",
        "{a:1}",
        "{\"a\":1,}",
        "01",
        "1.",
        ".5",
        "1e",
        "+1",
        "--1",
        "nan",
        "Infinity",
        "tru",
        "\"abc",
        "\"\\x\"",
        "\"\\u12g4\"",
        "\"\\",
        "\"a\nb\"",
        "1 2",
        "{} {}",
        "\xff\xfe",
        "\"\xc3\"",
        "\"\xed\xa0\x80\"",
        "\"\xc0\xaf\"",
        "[[[[[[[[[[[[[[[[[[1]]]]]]]]]]]]]]]]]]",
        "'a'",
        "/**/1",
        "[1,2,3,4,5,6,7,8,9,1,2,3,4,5,6,7,8,9,1,2,3,4,5,6,7,8,9,1,2,3,4,5,6,7,8,9,1,2,3,4,5,6,7,8,9,1,2,3,4,5,6,7,8,9,"
        "1,2,3,4,"
        "5,6,7,8,9,1,2,3,4,5,6,7,8,9]",
    };
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
        if (parse(texts[i]) == NULL) {
            (void)fprintf(stderr, "accepted: %s\n", texts[i]);
            exit(1);
        }
    }
    CHECK(fcsl_json_parse("\"a\0b\"", 5, tokens, TOKENS, &json) != NULL);
}

/* Every prefix and every single-byte change of a request parses or is refused, but is never read beyond its end. */
static void test_every_damage(void)
{
    static const char text[] =
        "{\"cmd\":\"set\",\"path\":\"a.b[1]\",\"value\":[1.5,-2e9,\"nan\",{\"x\":null}],\"id\":\"\\u0041\"}";
    const size_t size = sizeof text - 1;
    for (size_t cut = 0; cut < size; cut++) {
        char *copy = malloc(cut + 1);
        CHECK(copy != NULL);
        memcpy(copy, text, cut);
        CHECK(fcsl_json_parse(copy, cut, tokens, TOKENS, &json) != NULL);
        free(copy);
    }
    char *copy = malloc(size);
    CHECK(copy != NULL);
    for (size_t at = 0; at < size; at++) {
        for (int value = 0; value < 256; value++) {
            memcpy(copy, text, size);
            copy[at] = (char)value;
            if (fcsl_json_parse(copy, size, tokens, TOKENS, &json) == NULL) {
                for (uint32_t i = 0; i < json.count; i++) {
                    char out[16];
                    CHECK(tokens[i].start <= tokens[i].end && tokens[i].end <= size && tokens[i].next <= json.count);
                    (void)fcsl_json_string(&json, i, out, sizeof out);
                }
            }
        }
    }
    free(copy);
}

static void test_members(void)
{
    char text[32];
    CHECK(parse("{\"a\":{\"b\":1},\"c\":\"x\\ty\\u00e9\",\"d\":[1,2]}") == NULL);
    CHECK(fcsl_json_member(&json, 0, "b") == 0 && fcsl_json_member(&json, 0, "e") == 0 &&
          fcsl_json_member(&json, 0, "") == 0);
    const uint32_t c = fcsl_json_member(&json, 0, "c");
    CHECK(c != 0 && fcsl_json_string(&json, c, text, sizeof text) == 0 && strcmp(text, "x\ty\xc3\xa9") == 0);
    CHECK(fcsl_json_string(&json, c, text, 5) != 0);
    const uint32_t d = fcsl_json_member(&json, 0, "d");
    CHECK(tokens[d].type == JSON_ARRAY && tokens[d].count == 2 && fcsl_json_string(&json, d, text, sizeof text) != 0);
    CHECK(parse("\"\\u0000\"") == NULL && fcsl_json_string(&json, 0, text, sizeof text) != 0);
}

static uint64_t random_state = 42;

static uint64_t random_u64(void)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 7;
    random_state ^= random_state << 17;
    return random_state;
}

static void test_floats_round_trip(void)
{
    char text[64];
    for (int i = 0; i < 200000; i++) {
        json_out_t out;
        double f64 = 0.0;
        float f32 = 0.0f;
        const uint64_t bits = random_u64();
        memcpy(&f64, &bits, sizeof f64);
        memcpy(&f32, &bits, sizeof f32);
        fcsl_json_begin(&out, text, sizeof text);
        fcsl_json_f64(&out, f64);
        if (isfinite(f64)) {
            const double back = strtod(text, NULL);
            CHECK(parse(text) == NULL && memcmp(&back, &f64, sizeof back) == 0 && strpbrk(text, ".e") != NULL);
        }
        fcsl_json_begin(&out, text, sizeof text);
        fcsl_json_f32(&out, f32);
        if (isfinite(f32)) {
            const float back = strtof(text, NULL);
            CHECK(parse(text) == NULL && memcmp(&back, &f32, sizeof back) == 0);
        }
    }
}

/* Digits that tell neighbours apart, and no more; always a float. */
static void test_floats_as_text(void)
{
    static const struct {
        double value;
        const char *f64;
        const char *f32;
    } cases[] = {
        {0.0, "0.0", "0.0"},
        {-0.0, "-0.0", "-0.0"},
        {1.0, "1.0", "1.0"},
        {-20.5, "-20.5", "-20.5"},
        {0.1, "0.10000000000000001", "0.100000001"},
        {1e30, "1e+30", "1.00000002e+30"},
        {(double)INFINITY, "\"inf\"", "\"inf\""},
        {-(double)INFINITY, "\"-inf\"", "\"-inf\""},
        {(double)NAN, "\"nan\"", "\"nan\""},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char text[64];
        json_out_t out;
        fcsl_json_begin(&out, text, sizeof text);
        fcsl_json_f64(&out, cases[i].value);
        CHECK(strcmp(text, cases[i].f64) == 0);
        fcsl_json_begin(&out, text, sizeof text);
        fcsl_json_f32(&out, (float)cases[i].value);
        CHECK(strcmp(text, cases[i].f32) == 0);
    }
}

static void test_integers_as_printf(void)
{
    char text[32];
    char expected[32];
    json_out_t out;
    for (int i = 0; i < 100000; i++) {
        const uint64_t value = i < 3 ? UINT64_MAX - (uint64_t)i : random_u64() >> (i % 64);
        fcsl_json_begin(&out, text, sizeof text);
        fcsl_json_u64(&out, value);
        (void)snprintf(expected, sizeof expected, "%" PRIu64, value);
        CHECK(strcmp(text, expected) == 0);
        const int64_t integer = i == 0 ? INT64_MIN : i % 2 != 0 ? -(int64_t)(value / 2) : (int64_t)(value / 2);
        fcsl_json_begin(&out, text, sizeof text);
        fcsl_json_i64(&out, integer);
        (void)snprintf(expected, sizeof expected, "%" PRId64, integer);
        CHECK(strcmp(text, expected) == 0);
    }
}

static void test_writer_is_bounded(void)
{
    char text[8];
    json_out_t out;
    fcsl_json_begin(&out, text, sizeof text);
    fcsl_json_quoted(&out, "a\"b\x01");
    CHECK(out.overflow && strlen(text) < sizeof text);
    fcsl_json_begin(&out, text, sizeof text);
    fcsl_json_quoted(&out, "a\"b");
    CHECK(!out.overflow && strcmp(text, "\"a\\\"b\"") == 0);
    fcsl_json_text(&out, "1");
    CHECK(!out.overflow);
    fcsl_json_text(&out, "2");
    CHECK(out.overflow && strcmp(text, "\"a\\\"b\"1") == 0);
}

/* Whatever bytes a text holds (a path that was cut, a name of a file), what is written is JSON; what is UTF-8 reads back. */
static void test_any_bytes_are_quoted(void)
{
    static const char *const texts[][2] = {{"", ""},
                                           {"\x7f\xc3\xa9\xe2\x82\xac\xf0\x9d\x84\x9e", NULL},
                                           {"a\xc3", "a\xef\xbf\xbd"},
                                           {"\xf0\x9d\x84'", "\xef\xbf\xbd'"},
                                           {"\xe2\x82\xc3\xa9", "\xef\xbf\xbd\xc3\xa9"},
                                           {"\xff\xc3\xa9", "\xef\xbf\xbd\xc3\xa9"},
                                           {"\x80z", "\xef\xbf\xbdz"}};
    char text[256];
    char back[64];
    json_out_t out;
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
        fcsl_json_begin(&out, text, sizeof text);
        fcsl_json_quoted(&out, texts[i][0]);
        CHECK(parse(text) == NULL && fcsl_json_string(&json, 0, back, sizeof back) == 0);
        CHECK(strcmp(back, texts[i][texts[i][1] != NULL]) == 0);
    }
    for (int i = 0; i < 200000; i++) {
        const uint64_t lot = random_u64();
        const uint64_t bits = random_u64() | (random_u64() & UINT64_C(0x8080808080808080));
        char bytes[9] = "";
        memcpy(bytes, &bits, (size_t)lot % 9u);
        fcsl_json_begin(&out, text, sizeof text);
        fcsl_json_quoted(&out, bytes);
        CHECK(!out.overflow && parse(text) == NULL && fcsl_json_string(&json, 0, back, sizeof back) == 0);
        CHECK(strcmp(back, bytes) == 0 || strstr(back, "\xef\xbf\xbd") != NULL);
    }
}

static void test_base64(void)
{
    uint8_t bytes[64] = {0};
    uint8_t back[64] = {0};
    char text[BASE64_BYTES(sizeof bytes)];
    fcsl_base64_encode((const uint8_t *)"foob", 4, text);
    CHECK(strcmp(text, "Zm9vYg==") == 0);
    for (size_t size = 0; size <= sizeof bytes; size++) {
        for (size_t i = 0; i < size; i++) {
            bytes[i] = (uint8_t)random_u64();
        }
        fcsl_base64_encode(bytes, size, text);
        CHECK(fcsl_base64_decode(text, strlen(text), back, size) == 0 && memcmp(bytes, back, size) == 0);
        CHECK(fcsl_base64_decode(text, strlen(text), back, size + 3) != 0);
    }
    CHECK(fcsl_base64_decode("Zm9vYg=", 7, back, 4) != 0 && fcsl_base64_decode("Zm9v!g==", 8, back, 4) != 0);
    CHECK(fcsl_base64_decode("Zm9vYgaa", 8, back, 4) != 0);
}

int main(void)
{
    test_accepted();
    test_refused();
    test_every_damage();
    test_members();
    test_floats_round_trip();
    test_floats_as_text();
    test_integers_as_printf();
    test_writer_is_bounded();
    test_any_bytes_are_quoted();
    test_base64();
    return 0;
}
