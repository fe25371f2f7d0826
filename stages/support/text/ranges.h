// stages/support/text/ranges.h: reads, applies and writes changes of keys, with or without a range of heights.
#pragma once

#include <algorithm>

#include "stages/support/text/changes.h"
#include "stages/support/text/key.h"

namespace lamina {

/// "2.7:3", for messages.
std::string range_name(double from_mm, double to_mm);

/// Removes from_mm and to_mm from a table into the arguments. returns "" or an error message
std::string take_ends(TomlValue& table, double& from_mm, double& to_mm, TextPosition& at);

/// "is an array of tables; ..." for any other value, else "".
std::string check_tables(const TomlValue& value, std::string_view example);

template <class Target>
void apply(std::span<const Key<Target>> keys, const Changes<Target>& changes, Target& target) {
  for (const std::size_t key : changes.keys) keys[key].copy(changes.values, target);
}

template <class Target>
std::string read_changes(const TomlValue& table, std::span<const Key<Target>> keys, Changes<Target>& changes,
                         TextPosition& at) {
  if (!table.is_table()) return "is a table of keys, as in { gap_mm = 0.1 }";
  Changes<Target> read;
  auto wrong = read_table(table, keys.front().section, keys, read.values, at, &read.keys);
  std::ranges::sort(read.keys);
  read.keys.erase(std::unique(read.keys.begin(), read.keys.end()), read.keys.end());
  if (wrong.empty()) changes = std::move(read);
  return wrong;
}

/// "gap_mm = [0], angle_deg = 90"
template <class Target>
std::string changes_text(std::span<const Key<Target>> keys, const Changes<Target>& changes) {
  std::string text;
  for (const std::size_t key : changes.keys) {
    text += (text.empty() ? "" : ", ") + key_line(keys[key].name, keys[key].form, keys[key].write(changes.values));
  }
  return text;
}

/// Ranges in the order of their heights, disjoint.
template <class Target>
std::string read_ranges(const TomlValue& list, std::span<const Key<Target>> keys, std::vector<Range<Target>>& ranges,
                        TextPosition& at) {
  if (auto wrong = check_tables(list, "from_mm, to_mm and the keys that differ"); !wrong.empty()) return wrong;
  std::vector<Range<Target>> read;
  for (TomlValue table : list.value) {
    Range<Target>& range = read.emplace_back();
    at = table.position;
    if (auto wrong = take_ends(table, range.from_mm, range.to_mm, at); !wrong.empty()) return wrong;
    const std::string name = range_name(range.from_mm, range.to_mm);
    if (auto wrong = read_changes(table, keys, range.changes, at); !wrong.empty()) return fmt::format("{}: {}", name, wrong);
    for (std::size_t i = 0; i + 1 < read.size(); ++i) {
      if (range.from_mm >= read[i].to_mm || read[i].from_mm >= range.to_mm) continue;
      return fmt::format("{} overlaps {}; end one where the other begins", name, range_name(read[i].from_mm, read[i].to_mm));
    }
  }
  std::ranges::sort(read, {}, &Range<Target>::from_mm);
  ranges = std::move(read);
  return {};
}

/// "[{ from_mm = 2.7, to_mm = 3, gap_mm = [0] }]", empty if there is none.
template <class Target>
std::string ranges_text(std::span<const Key<Target>> keys, const std::vector<Range<Target>>& ranges) {
  std::string text;
  for (const Range<Target>& range : ranges) {
    const std::string changes = changes_text(keys, range.changes);
    text += fmt::format("{}{{ from_mm = {}, to_mm = {}{}{} }}", text.empty() ? "" : ", ", number_text(range.from_mm),
                        number_text(range.to_mm), changes.empty() ? "" : ", ", changes);
  }
  return text.empty() ? text : fmt::format("[{}]", text);
}

}  // namespace lamina
