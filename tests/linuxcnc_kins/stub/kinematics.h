#pragma once
typedef struct { double x, y, z; } PmCartesian;
typedef struct { PmCartesian tran; double a, b, c, u, v, w; } EmcPose;
typedef unsigned long int KINEMATICS_FORWARD_FLAGS;
typedef unsigned long int KINEMATICS_INVERSE_FLAGS;
typedef enum { KINEMATICS_IDENTITY = 1, KINEMATICS_FORWARD_ONLY, KINEMATICS_INVERSE_ONLY, KINEMATICS_BOTH } KINEMATICS_TYPE;
