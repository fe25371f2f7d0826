#include "stages/support/text/ranges.h"

namespace lamina {

std::string range_name(double from_mm, double to_mm) { return fmt::format("{}:{}", number_text(from_mm), number_text(to_mm)); }

std::string take_ends(TomlValue& table, double& from_mm, double& to_mm, TextPosition& at) {
  for (const auto& [name, end] : {std::pair{"from_mm", &from_mm}, {"to_mm", &to_mm}}) {
    at = table.position;
    const TomlValue* value = table.find(name);
    if (value == nullptr) return fmt::format("{} is missing; give both ends, from_mm and to_mm", name);
    at = value->position;
    if (!value->is_text()) return fmt::format("{}: is not a number", name);
    if (auto wrong = read_number(value->text, 0, kMaxMm, " mm", *end); !wrong.empty())
      return fmt::format("{}: {}", name, wrong);
    table.remove(name);
  }
  if (from_mm < to_mm) return {};
  return fmt::format("{} ends at or below its start; write the lower height as from_mm", range_name(from_mm, to_mm));
}

std::string check_tables(const TomlValue& value, std::string_view example) {
  if (value.is_list() && std::ranges::all_of(value.value, &TomlValue::is_table)) return {};
  return fmt::format("is an array of tables, each with {}", example);
}

}  // namespace lamina
