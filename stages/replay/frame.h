// stages/replay/frame.h: what precedes the first layer of a program and follows its last.
#pragma once

#include <string_view>

#include "stages/data/status.h"
#include "stages/replay/machine.h"

namespace lamina::replay {

/// Whether programs of layers find the machine as they take it to be: units, ways of counting, zeros, and what a header says of
/// the head and the image. errors  kVerification: "line 3: what is wrong", or what is missing
Status check_start(const VirtualMachine& machine, std::string_view text);

/// Whether the end says that the program is over, where its dialect does, and moves nothing that it need not.
/// errors  kVerification
Status check_end(const VirtualMachine& machine, std::string_view text);

}  // namespace lamina::replay
