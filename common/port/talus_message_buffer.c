/* Byte copies of port messages. */
#include <stdint.h>
#include <string.h>

void talus_copy_bytes(void *to, const void *from, int64_t bytes);
void talus_text_to_words(uint64_t *word, const char *text, int64_t bytes);
void talus_words_to_text(char *text, const uint64_t *word, int64_t bytes);

void talus_copy_bytes(void *to, const void *from, int64_t bytes)
{
    if (bytes > 0)
        memcpy(to, from, (size_t)bytes);
}

void talus_text_to_words(uint64_t *word, const char *text, int64_t bytes)
{
    talus_copy_bytes(word, text, bytes);
}

void talus_words_to_text(char *text, const uint64_t *word, int64_t bytes)
{
    talus_copy_bytes(text, word, bytes);
}
