#pragma once
int rtapi_app_main(void);
void rtapi_app_exit(void);
