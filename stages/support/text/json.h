// stages/support/text/json.h: the former name of json_value.h.
#pragma once

#include "stages/support/text/json_value.h"
