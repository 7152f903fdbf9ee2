#include "view/view_request.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#define RADIANS (M_PI / 180.0)
#define DIRECTION_MOST_DEG 360.0

bool view_token_make(char token[VIEW_TOKEN_BYTES]) {
    unsigned char random[(VIEW_TOKEN_BYTES - 1u) / 2u];
    if (getrandom(random, sizeof random, 0) != (ssize_t)sizeof random) {
        return false;
    }
    for (size_t i = 0; i < sizeof random; i++) {
        (void)snprintf(token + 2 * i, 3, "%02x", random[i]);
    }
    return true;
}

static bool is_token(const char *token) {
    for (const char *at = token; *at != '\0'; at++) {
        if (strchr("0123456789abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ-_", *at) == NULL) {
            return false;
        }
    }
    return strlen(token) >= VIEW_TOKEN_LEAST;
}

static bool read_token(int file, const char *path, char token[VIEW_TOKEN_BYTES], char *error,
                       size_t error_bytes) {
    struct stat status;
    char line[VIEW_TOKEN_BYTES + 1];
    if (fstat(file, &status) != 0 || (status.st_mode & (S_IRWXG | S_IRWXO)) != 0) {
        (void)snprintf(error, error_bytes, "%s: others may read it: chmod 600 %s", path, path);
        return false;
    }
    const ssize_t count = read(file, line, sizeof line - 1);
    line[count > 0 ? count : 0] = '\0';
    line[strcspn(line, "\r\n")] = '\0';
    if (!is_token(line) || strlen(line) >= VIEW_TOKEN_BYTES) {
        (void)snprintf(
            error, error_bytes,
            "%s: its first line must be %u to %u letters, digits, - and _: openssl rand -hex 32 >%s", path,
            VIEW_TOKEN_LEAST, VIEW_TOKEN_BYTES - 1u, path);
        return false;
    }
    memcpy(token, line, strlen(line) + 1);
    return true;
}

bool view_token_read(const char *path, char token[VIEW_TOKEN_BYTES], char *error, size_t error_bytes) {
    const int file = open(path, O_RDONLY | O_CLOEXEC);
    if (file < 0) {
        (void)snprintf(error, error_bytes, "%s: %s", path, strerror(errno));
        return false;
    }
    const bool sound = read_token(file, path, token, error, error_bytes);
    (void)close(file);
    return sound;
}

bool view_token_matches(const struct view_access *access, const char *given) {
    const size_t length = strlen(access->token);
    if (given == NULL || strlen(given) != length || length == 0) {
        return false;
    }
    unsigned difference = 0;
    for (size_t i = 0; i < length; i++) {
        difference |= (unsigned)(unsigned char)(access->token[i] ^ given[i]);
    }
    return difference == 0;
}

/* `host` is `name`, with or without a port. */
static bool is_host(const char *host, const char *name) {
    const size_t length = strlen(name);
    if (strncasecmp(host, name, length) != 0) {
        return false;
    }
    const char *rest = host + length;
    return *rest == '\0' || (*rest == ':' && rest[1 + strspn(rest + 1, "0123456789")] == '\0');
}

bool view_host_is_loopback(const char *host) {
    return host != NULL &&
           (is_host(host, "127.0.0.1") || is_host(host, "localhost") || is_host(host, "[::1]"));
}

bool view_origin_is_own(const char *origin, const char *host) {
    static const char scheme[] = "http://";
    if (origin == NULL) {
        return true;
    }
    return host != NULL && strncmp(origin, scheme, sizeof scheme - 1) == 0 &&
           strcmp(origin + sizeof scheme - 1, host) == 0;
}

bool view_address_is_loopback(const char *address) {
    struct in_addr four;
    struct in6_addr six;
    if (inet_pton(AF_INET, address, &four) == 1) {
        return (ntohl(four.s_addr) >> 24) == 127u;
    }
    return inet_pton(AF_INET6, address, &six) == 1 && memcmp(&six, &in6addr_loopback, sizeof six) == 0;
}

static json_t *parse(const char *body, char *error, size_t error_bytes) {
    json_error_t why;
    json_t *root = json_loads(body, JSON_REJECT_DUPLICATES, &why);
    if (root == NULL || !json_is_object(root)) {
        (void)snprintf(error, error_bytes, "the body is not a JSON object: %s",
                       root == NULL ? why.text : "something else");
        json_decref(root);
        return NULL;
    }
    return root;
}

static bool take_page(const json_t *root, char page[VIEW_PAGE_BYTES], char *error, size_t error_bytes) {
    const char *text = json_string_value(json_object_get(root, "page"));
    if (text == NULL || *text == '\0' || strlen(text) >= VIEW_PAGE_BYTES) {
        (void)snprintf(error, error_bytes, "\"page\" must be a text of 1 to %u characters",
                       VIEW_PAGE_BYTES - 1u);
        return false;
    }
    memcpy(page, text, strlen(text) + 1);
    return true;
}

static bool take_number(const json_t *root, const char *key, double least, double most, double *value,
                        char *error, size_t error_bytes) {
    const json_t *number = json_object_get(root, key);
    *value = json_number_value(number);
    if (!json_is_number(number) || !(*value >= least && *value <= most)) {
        (void)snprintf(error, error_bytes, "\"%s\" must be a number from %g to %g", key, least, most);
        return false;
    }
    return true;
}

static bool has_only(const json_t *root, size_t keys, char *error, size_t error_bytes) {
    if (json_object_size(root) != keys) {
        (void)snprintf(error, error_bytes, "%zu keys are expected, there are %zu", keys,
                       json_object_size(root));
        return false;
    }
    return true;
}

bool view_request_page(const char *body, char page[VIEW_PAGE_BYTES], char *error, size_t error_bytes) {
    json_t *root = parse(body, error, error_bytes);
    const bool sound =
        root != NULL && take_page(root, page, error, error_bytes) && has_only(root, 1, error, error_bytes);
    json_decref(root);
    return sound;
}

bool view_request_command(const char *body, const struct bend_table_module *module,
                          char page[VIEW_PAGE_BYTES], struct controller_command *command, char *error,
                          size_t error_bytes) {
    /* what the page shows is rounded: a hair over the limit is the limit */
    const double bend_most_deg = (double)module->bend_limit_rad / RADIANS + 1e-3;
    const double pressure_most_kpa = 1e-3 * (double)module->working_pressure_pa + 1e-6;
    double bend_deg = 0.0, direction_deg = 0.0, co_contraction_kpa = 0.0;
    json_t *root = parse(body, error, error_bytes);
    const bool sound = root != NULL && take_page(root, page, error, error_bytes) &&
                       take_number(root, "bend_deg", 0.0, bend_most_deg, &bend_deg, error, error_bytes) &&
                       take_number(root, "direction_deg", -DIRECTION_MOST_DEG, DIRECTION_MOST_DEG,
                                   &direction_deg, error, error_bytes) &&
                       take_number(root, "co_contraction_kpa", 0.0, pressure_most_kpa, &co_contraction_kpa,
                                   error, error_bytes) &&
                       has_only(root, 4, error, error_bytes);
    json_decref(root);
    *command = (struct controller_command){.kind = COMMAND_BEND,
                                           .bend_rad = (float)(bend_deg * RADIANS),
                                           .direction_rad = (float)(direction_deg * RADIANS),
                                           .co_contraction_pa = (float)(1e3 * co_contraction_kpa)};
    return sound;
}
