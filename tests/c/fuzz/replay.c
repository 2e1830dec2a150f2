/* Runs a fuzz target over the files of a folder: with any compiler, as a test. */
#include <dirent.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int main(int count, char **arguments)
{
    DIR *folder = (count == 2) ? opendir(arguments[1]) : NULL;
    const struct dirent *entry;
    unsigned files = 0;
    if (folder == NULL) {
        fprintf(stderr, "usage: %s FOLDER\n", arguments[0]);
        return 2;
    }
    while ((entry = readdir(folder)) != NULL) {
        char path[1024];
        static uint8_t octets[65536];
        uint8_t *exact; /* so that a sanitizer sees its end */
        size_t n;
        FILE *file;
        if (entry->d_name[0] == '.') {
            continue;
        }
        (void)snprintf(path, sizeof path, "%s/%s", arguments[1], entry->d_name);
        file = fopen(path, "rb");
        if (file == NULL) {
            perror(path);
            return 2;
        }
        n = fread(octets, 1, sizeof octets, file);
        (void)fclose(file);
        exact = malloc((n != 0) ? n : 1);
        if (exact == NULL) {
            return 2;
        }
        for (size_t k = 0; k < n; k++) {
            exact[k] = octets[k];
        }
        fprintf(stderr, "%s\n", entry->d_name); /* the last one is the one that failed */
        (void)LLVMFuzzerTestOneInput(exact, n);
        free(exact);
        files++;
    }
    (void)closedir(folder);
    printf("%u inputs\n", files);
    return (files != 0) ? 0 : 1;
}
