#include "pipeline/job/lists/old_forms.h"

#include <fmt/format.h>

#include "stages/support/text/number_text.h"

namespace lamina::read {
namespace {

using Text = std::string_view;
using Kind = TomlValue::Kind;

TomlValue leaf(Text text, const Place& place) { return {Kind::kText, std::string(trimmed(text)), {}, {}, place}; }
TomlValue empty(Kind kind, const Place& place) { return {kind, {}, {}, {}, place}; }

/// "0:0.75, 6:0.1" as [[0, 0.75], [6, 0.1]].
TomlValue gaps_of(const TomlValue& old, std::string& wrong) {
  TomlValue list = empty(Kind::kList, old.place);
  for (const Text entry : split(old.text, ",")) {
    const auto pair = split(entry, ":");
    if (pair.size() != 2) wrong = fmt::format("'{}' is not height:gap, as in 0:0.75,6:0.1", trimmed(entry));
    TomlValue row = empty(Kind::kList, old.place);
    for (const Text text : pair) row.value.push_back(leaf(text, old.place));
    list.value.push_back(std::move(row));
  }
  return list;
}

/// "gap_mm=0 angle_deg=90" as the entries of a table.
void add_changes(Text text, const Place& place, TomlValue& table, std::string& wrong) {
  for (const Text change : split(text, " ")) {
    if (change.empty()) continue;
    const std::size_t equals = change.find('=');
    if (equals == Text::npos) {
      wrong = fmt::format("'{}' is not key=value, as in gap_mm=0.2", change);
      return;
    }
    const Text name = change.substr(0, equals);
    TomlValue value = leaf(change.substr(equals + 1), place);
    table.add(name, name == "gap_by_height" ? gaps_of(value, wrong) : std::move(value));
  }
}

TomlValue changes_of(const TomlValue& old, std::string& wrong) {
  TomlValue table = empty(Kind::kTable, old.place);
  add_changes(old.text, old.place, table, wrong);
  return table;
}

/// "2.7:3 gap_mm=0; 5.7:6 pattern=contour" or "2:4 bronze" as an array of tables.
TomlValue ranges_of(const TomlValue& old, bool of_material, std::string& wrong) {
  TomlValue list = empty(Kind::kList, old.place);
  for (Text piece : split(old.text, ";")) {
    piece = trimmed(piece);
    if (piece.empty()) continue;
    const std::size_t space = std::min(piece.find(' '), piece.size());
    const auto ends = split(piece.substr(0, space), ":");
    if (ends.size() != 2) {
      wrong = fmt::format("'{}' is no range from:to in mm, as in 2.7:3", piece.substr(0, space));
      return list;
    }
    TomlValue table = empty(Kind::kTable, old.place);
    table.add("from_mm", leaf(ends[0], old.place));
    table.add("to_mm", leaf(ends[1], old.place));
    if (of_material) {
      table.add("material", leaf(piece.substr(space), old.place));
    } else {
      add_changes(piece.substr(space), old.place, table, wrong);
    }
    list.value.push_back(std::move(table));
  }
  return list;
}

struct OldForm {
  Text section, name, now, write;
  TomlValue (*convert)(const TomlValue& old, std::string& wrong);
};

const OldForm kForms[] = {
    {"fill", "by_height", "range", "tables [[fill.range]] with from_mm, to_mm and keys",
     [](const TomlValue& old, std::string& wrong) { return ranges_of(old, false, wrong); }},
    {"segment", "by_height", "range", "tables [[segment.range]] with from_mm, to_mm and keys",
     [](const TomlValue& old, std::string& wrong) { return ranges_of(old, false, wrong); }},
    {"part", "material_by_height", "material_range", "tables [[part.material_range]] with from_mm, to_mm and material",
     [](const TomlValue& old, std::string& wrong) { return ranges_of(old, true, wrong); }},
    {"part", "fill", "fill", "a table, as in fill = { gap_mm = 0.1, walls = 2 }", changes_of},
    {"fill", "gap_by_height", "gap_by_height", "a list of heights and gaps, as in [[0, 0.75], [6, 0.1]]", gaps_of},
    {"extrude", "set", "machine", "a table [extrude.machine] with keys of the profile, as in fan.from_layer = 2",
     [](const TomlValue& old, std::string&) { return old; }},
};

Status replace_in(TomlValue& table, Text section, const std::string& file, std::vector<std::string>& notes) {
  for (const OldForm& form : kForms) {
    TomlValue* old = form.section == section ? table.find(form.name) : nullptr;
    if (old == nullptr || !old->is_text()) continue;
    const std::string where = fmt::format("{}{}.{}: ", old->place.text(file), section, form.name);
    std::string wrong;
    TomlValue now = form.convert(*old, wrong);
    if (!wrong.empty()) return Error{Fault::kUsage, where + wrong};
    notes.push_back(fmt::format("{}the string is an old form, read until the next version; write {}", where, form.write));
    table.remove(form.name);
    table.add(form.now, std::move(now));
  }
  return {};
}

}  // namespace

Status replace_old_forms(TomlValue& job, const std::string& file, std::vector<std::string>& notes) {
  for (std::size_t i = 0; i < job.value.size(); ++i) {
    TomlValue& section = job.value[i];
    if (section.is_table()) {
      if (Status status = replace_in(section, job.name[i], file, notes); !status) return status;
    }
    for (TomlValue& part : section.value) {
      if (!section.is_list() || !part.is_table()) continue;
      if (Status status = replace_in(part, job.name[i], file, notes); !status) return status;
    }
  }
  return {};
}

}  // namespace lamina::read
