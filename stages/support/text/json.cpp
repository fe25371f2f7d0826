#include "stages/support/text/json.h"

namespace lamina {

std::string json_line(const Json& value, int indent) {
  return value.dump(indent, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace lamina
