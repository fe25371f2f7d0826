// pipeline/pores/pore_page.h: what there is to say of the pores of a window, for people and for programs.
#pragma once

#include <string>

#include "pipeline/pores/predict_flow.h"
#include "pipeline/pores/predict_inertia.h"
#include "pipeline/pores/window_choice.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

/// Lines that end with LF; k1 in darcy and m2.
std::string as_text(const WindowChoice& choice, const PoreReport& report);

/// The same, k1 as a tensor: a row for each axis of the force that was asked for.
Json as_json(const WindowChoice& choice, const PoreReport& report);

/// k2 along z, and what it was fitted on.
std::string as_text(const Forchheimer& inertia);
Json as_json(const Forchheimer& inertia);

}  // namespace lamina::pipeline
