/* Runs a fuzz target over a file of inputs, one a line in hex: with any compiler, as a test. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define LONGEST 65536u

static int digit(int c)
{
    if ((c >= '0') && (c <= '9')) {
        return c - '0';
    }
    return ((c >= 'a') && (c <= 'f')) ? c - 'a' + 10 : -1;
}

/* The bytes of the next line: their number, -1 at the end of the file, -2 if it is not hex. */
static long next(FILE *file, uint8_t *bytes)
{
    long n = 0;
    int c = getc(file);
    if (c == EOF) {
        return -1;
    }
    while ((c != '\n') && (c != EOF)) {
        int high = digit(c);
        int low = digit(getc(file));
        if ((high < 0) || (low < 0) || (n == (long)LONGEST)) {
            return -2;
        }
        bytes[n] = (uint8_t)(high * 16 + low);
        n++;
        c = getc(file);
    }
    return n;
}

int main(int count, char **arguments)
{
    static uint8_t bytes[LONGEST];
    FILE *file = (count == 2) ? fopen(arguments[1], "r") : NULL;
    unsigned inputs = 0;
    long n;
    if (file == NULL) {
        fprintf(stderr, "usage: %s FILE.hex\n", arguments[0]);
        return 2;
    }
    for (n = next(file, bytes); n >= 0; n = next(file, bytes)) {
        uint8_t *exact = malloc((n != 0) ? (size_t)n : 1u); /* so that a sanitizer sees its end */
        if (exact == NULL) {
            return 2;
        }
        for (long k = 0; k < n; k++) {
            exact[k] = bytes[k];
        }
        inputs++;
        fprintf(stderr, "line %u\n", inputs); /* the last one is the one that failed */
        (void)LLVMFuzzerTestOneInput(exact, (size_t)n);
        free(exact);
    }
    (void)fclose(file);
    if (n == -2) {
        fprintf(stderr, "%s, line %u: not hex\n", arguments[1], inputs + 1u);
        return 2;
    }
    printf("%u inputs\n", inputs);
    return (inputs != 0) ? 0 : 1;
}
