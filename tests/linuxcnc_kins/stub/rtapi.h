#pragma once
#define RTAPI_MSG_ERR 1
void rtapi_print_msg(int level, const char *format, ...);
#define EXPORT_SYMBOL(x)
#define MODULE_LICENSE(x)
#define MODULE_DESCRIPTION(x)
#define RTAPI_MP_STRING(var, says) void *rtapi_info_address_##var = &var;
