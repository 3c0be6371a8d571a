#pragma once
typedef volatile double hal_float_t;
typedef enum { HAL_IN = 16 } hal_pin_dir_t;
int hal_init(const char *name);
int hal_ready(int id);
int hal_exit(int id);
void *hal_malloc(long size);
int hal_pin_float_newf(hal_pin_dir_t dir, hal_float_t **pin, int id, const char *format, ...);
