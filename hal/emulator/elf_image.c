#include "emulator/elf_image.h"

#include <elf.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define FILE_BYTES_MOST (64u << 20)

struct elf_file {
    uint8_t *bytes;
    size_t size;
};

static bool refuse(char *error, size_t error_bytes, const char *path, const char *what) {
    (void)snprintf(error, error_bytes, "%s: %s", path, what);
    return false;
}

static bool read_all(const char *path, struct elf_file *file, char *error, size_t error_bytes) {
    FILE *stream = fopen(path, "rb");
    if (stream == NULL) {
        return refuse(error, error_bytes, path, strerror(errno));
    }
    file->size = fseek(stream, 0, SEEK_END) == 0 ? (size_t)ftell(stream) : 0;
    file->bytes = file->size > 0 && file->size <= FILE_BYTES_MOST ? malloc(file->size) : NULL;
    rewind(stream);
    const bool whole = file->bytes != NULL && fread(file->bytes, 1, file->size, stream) == file->size;
    (void)fclose(stream);
    if (!whole) {
        free(file->bytes);
        return refuse(error, error_bytes, path, "cannot be read whole");
    }
    return true;
}

static const void *part(const struct elf_file *file, uint64_t offset, uint64_t size) {
    return offset <= file->size && size <= file->size - offset ? file->bytes + offset : NULL;
}

static const Elf32_Ehdr *header(const struct elf_file *file, const char *path, char *error,
                                size_t error_bytes) {
    const Elf32_Ehdr *head = part(file, 0, sizeof *head);
    if (head == NULL || memcmp(head->e_ident, ELFMAG, SELFMAG) != 0) {
        (void)refuse(error, error_bytes, path, "not an ELF file; `make firmware` builds one");
        return NULL;
    }
    if (head->e_ident[EI_CLASS] != ELFCLASS32 || head->e_machine != EM_ARM || head->e_type != ET_EXEC) {
        (void)refuse(error, error_bytes, path, "not a 32-bit ARM executable");
        return NULL;
    }
    return head;
}

static bool load_segments(const struct elf_file *file, const Elf32_Ehdr *head, const char *path,
                          elf_segment take, void *context, char *error, size_t error_bytes) {
    for (uint32_t i = 0; i < head->e_phnum; i++) {
        const Elf32_Phdr *segment =
            part(file, head->e_phoff + (uint64_t)i * sizeof *segment, sizeof *segment);
        const uint8_t *bytes = segment == NULL ? NULL : part(file, segment->p_offset, segment->p_filesz);
        if (bytes == NULL) {
            return refuse(error, error_bytes, path, "cut short: a segment lies beyond its end");
        }
        if (segment->p_type == PT_LOAD && segment->p_filesz > 0 &&
            !take(context, segment->p_paddr, bytes, segment->p_filesz)) {
            return refuse(error, error_bytes, path,
                          "has a segment outside the flash and RAM of the STM32G474");
        }
    }
    return true;
}

bool elf_load(const char *path, elf_segment take, void *context, char *error, size_t error_bytes) {
    struct elf_file file;
    if (!read_all(path, &file, error, error_bytes)) {
        return false;
    }
    const Elf32_Ehdr *head = header(&file, path, error, error_bytes);
    const bool loaded = head != NULL && load_segments(&file, head, path, take, context, error, error_bytes);
    free(file.bytes);
    return loaded;
}

static const Elf32_Shdr *section(const struct elf_file *file, const Elf32_Ehdr *head, uint32_t index) {
    return part(file, head->e_shoff + (uint64_t)index * sizeof(Elf32_Shdr), sizeof(Elf32_Shdr));
}

static bool find_in(const struct elf_file *file, const Elf32_Shdr *symbols, const Elf32_Shdr *strings,
                    const char *name, uint32_t *address, uint32_t *bytes) {
    for (uint64_t at = 0; at + sizeof(Elf32_Sym) <= symbols->sh_size; at += sizeof(Elf32_Sym)) {
        const Elf32_Sym *symbol = part(file, symbols->sh_offset + at, sizeof *symbol);
        const char *text =
            symbol == NULL || symbol->st_name >= strings->sh_size
                ? NULL
                : part(file, (uint64_t)strings->sh_offset + symbol->st_name, strlen(name) + 1u);
        if (text != NULL && memcmp(text, name, strlen(name) + 1u) == 0) {
            *address = symbol->st_value & ~(ELF32_ST_TYPE(symbol->st_info) == STT_FUNC ? 1u : 0u);
            *bytes = symbol->st_size;
            return true;
        }
    }
    return false;
}

bool elf_symbol(const char *path, const char *name, uint32_t *address, uint32_t *bytes) {
    char error[256];
    struct elf_file file;
    bool found = false;
    if (!read_all(path, &file, error, sizeof error)) {
        return false;
    }
    const Elf32_Ehdr *head = header(&file, path, error, sizeof error);
    for (uint32_t i = 0; head != NULL && i < head->e_shnum && !found; i++) {
        const Elf32_Shdr *symbols = section(&file, head, i);
        const Elf32_Shdr *strings = symbols == NULL ? NULL : section(&file, head, symbols->sh_link);
        found = symbols != NULL && symbols->sh_type == SHT_SYMTAB && strings != NULL &&
                find_in(&file, symbols, strings, name, address, bytes);
    }
    free(file.bytes);
    return found;
}
