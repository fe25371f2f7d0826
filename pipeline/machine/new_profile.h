// pipeline/machine/new_profile.h: the profile of an extrusion printer from answers to questions.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "stages/data/status.h"

namespace lamina::pipeline {

/// First line of every profile made from answers.
inline constexpr std::string_view kNewProfileMark = "# Made by lamina machines --new";

/// Shows a text, and returns the line that follows it; nothing at the end of the input.
using AnswerSource = std::function<std::optional<std::string>(const std::string& text)>;

/// Makes a profile from a line for each value; an empty line is the default. A wrong one is followed by the reason and the
/// same question. Speeds, retraction and code are those of the shipped profile of that firmware.
/// returns  TOML. errors  kUsage: the input ends, or an answer is wrong a hundred times
Result<std::string> new_profile(const AnswerSource& answer);

}  // namespace lamina::pipeline
