#include "program/gnuplot.h"

#include <errno.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

bool gnuplot_open(struct gnuplot *plot, const char *png_path, int width, int height, char *error, size_t error_bytes) {
    memset(plot, 0, sizeof *plot);
    const int length = snprintf(plot->path, sizeof plot->path, "%s", png_path);
    const int aside = snprintf(plot->aside, sizeof plot->aside, "%s.part", png_path);
    if (length <= 0 || aside < 0 || (size_t)aside >= sizeof plot->aside || strpbrk(png_path, "\"\\\n") != NULL) {
        (void)snprintf(error, error_bytes, "'%.64s' cannot be the path of a picture", png_path);
        return false;
    }
    FILE *probe = fopen(plot->aside, "wb"); /* gnuplot's own complaint about a path is hard to read */
    if (probe == NULL) {
        (void)snprintf(error, error_bytes, "cannot write %s: %s", plot->path, strerror(errno));
        return false;
    }
    (void)fclose(probe);
    plot->script = popen("gnuplot", "w"); // NOLINT(bugprone-command-processor,cert-env33-c): a fixed word
    if (plot->script == NULL) {
        (void)snprintf(error, error_bytes, "cannot start gnuplot: %s; install gnuplot-nox", strerror(errno));
        (void)remove(plot->aside);
        return false;
    }
    fprintf(plot->script, "set terminal pngcairo noenhanced font 'DejaVu Sans,11' size %d,%d\nset output \"%s\"\n", width,
            height, plot->aside);
    return true;
}

bool gnuplot_close(struct gnuplot *plot, char *error, size_t error_bytes) {
    struct stat state;
    fprintf(plot->script, "unset output\n");
    const int status = pclose(plot->script);
    plot->script = NULL;
    if (status != 0 || stat(plot->aside, &state) != 0 || state.st_size == 0 || rename(plot->aside, plot->path) != 0) {
        (void)snprintf(error, error_bytes, "gnuplot could not draw %s (is gnuplot-nox installed?)", plot->path);
        (void)remove(plot->aside);
        return false;
    }
    return true;
}
