/* Runs a kinematics module of LinuxCNC in an ordinary process: loads the shared object, plays HAL for it, and maps
 * what stands on standard input.
 *
 *     harness MODULE.so [coordinates]
 *
 *     set NAME VALUE              a pin, with the module's name
 *     get NAME                    -> its value
 *     inverse X Y Z A B C         -> joints 0..5
 *     forward J0 J1 J2 J3 J4 J5   -> X Y Z A B C
 *
 * Answers have 17 digits: doubles come back to the last bit. A line that cannot be done ends the process with code 1.
 */
#include <dlfcn.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* the layout of LinuxCNC's EmcPose: three coordinates, six more */
typedef struct { double v[9]; } pose;
typedef unsigned long flags;

#define MOST 256
static struct { char name[64]; double *value; } pins[MOST];
static int count;

static double *find(const char *name)
{
    for (int i = 0; i < count; i++)
        if (!strcmp(pins[i].name, name)) return pins[i].value;
    return 0;
}

/* ---- what a module calls */
int hal_init(const char *name) { (void)name; return 1; }
int hal_ready(int id) { (void)id; return 0; }
int hal_exit(int id) { (void)id; return 0; }
void *hal_malloc(long size) { return calloc(1, (size_t)size); }

static int new_pin(void **pin, const char *format, va_list list)
{
    if (count == MOST) return -1;
    int n = vsnprintf(pins[count].name, sizeof pins[count].name, format, list);
    /* HAL_NAME_LEN */
    if (n > 47 || find(pins[count].name)) return -1;
    *pin = pins[count].value = calloc(1, sizeof(double));
    count++;
    return 0;
}

int hal_pin_float_newf(int dir, double **pin, int id, const char *format, ...)
{
    (void)dir, (void)id;
    va_list list;
    va_start(list, format);
    int result = new_pin((void **)pin, format, list);
    va_end(list);
    return result;
}
/* the stock modules show their kinematics type on pins */
int hal_pin_bit_new(const char *name, int dir, void **pin, int id) { (void)name, (void)dir, (void)id; *pin = calloc(1, 8); return 0; }
int hal_pin_s32_new(const char *name, int dir, void **pin, int id) { (void)name, (void)dir, (void)id; *pin = calloc(1, 8); return 0; }
void rtapi_print(const char *format, ...) { (void)format; }
void rtapi_print_msg(int level, const char *format, ...)
{
    /* errors only: the modules also report how they start */
    if (level > 1) return;
    va_list list;
    va_start(list, format);
    vfprintf(stderr, format, list);
    va_end(list);
}

int main(int argc, char **argv)
{
    if (argc < 2) return 2;
    void *so = dlopen(argv[1], RTLD_NOW);
    if (!so) {
        fprintf(stderr, "%s\n", dlerror());
        return 2;
    }
    int (*start)(void) = (int (*)(void))dlsym(so, "rtapi_app_main");
    int (*forward)(const double *, pose *, const flags *, flags *) = (int (*)(const double *, pose *, const flags *, flags *))dlsym(so, "kinematicsForward");
    int (*inverse)(const pose *, double *, const flags *, flags *) = (int (*)(const pose *, double *, const flags *, flags *))dlsym(so, "kinematicsInverse");
    int (*type)(void) = (int (*)(void))dlsym(so, "kinematicsType");
    if (!start || !forward || !inverse || !type) {
        fprintf(stderr, "%s is no kinematics module\n", argv[1]);
        return 2;
    }
    if (argc > 2) {
        /* a module parameter is the variable that this symbol points at */
        void **at = (void **)dlsym(so, "rtapi_info_address_coordinates");
        if (!at) {
            fprintf(stderr, "%s takes no coordinates\n", argv[1]);
            return 2;
        }
        *(char **)*at = argv[2];
    }
    if (start()) return 3;
    printf("type %d\n", type());
    fflush(stdout);
    char line[1024];
    while (fgets(line, sizeof line, stdin)) {
        char name[64];
        double v[16] = { 0 };
        flags f = 0, g = 0;
        pose world = { { 0 } };
        if (sscanf(line, "set %63s %lf", name, &v[0]) == 2) {
            double *pin = find(name);
            if (!pin) {
                fprintf(stderr, "no pin %s\n", name);
                return 1;
            }
            *pin = v[0];
        } else if (sscanf(line, "get %63s", name) == 1) {
            double *pin = find(name);
            if (!pin) return 1;
            printf("%.17g\n", *pin);
        } else if (sscanf(line, "inverse %lf %lf %lf %lf %lf %lf", &world.v[0], &world.v[1], &world.v[2], &world.v[3], &world.v[4], &world.v[5]) == 6) {
            if (inverse(&world, v, &f, &g)) return 1;
            printf("%.17g %.17g %.17g %.17g %.17g %.17g\n", v[0], v[1], v[2], v[3], v[4], v[5]);
        } else if (sscanf(line, "forward %lf %lf %lf %lf %lf %lf", &v[0], &v[1], &v[2], &v[3], &v[4], &v[5]) == 6) {
            if (forward(v, &world, &f, &g)) return 1;
            printf("%.17g %.17g %.17g %.17g %.17g %.17g\n", world.v[0], world.v[1], world.v[2], world.v[3], world.v[4], world.v[5]);
        } else {
            fprintf(stderr, "not understood: %s", line);
            return 1;
        }
    }
    return 0;
}
