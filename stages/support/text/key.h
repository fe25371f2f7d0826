// stages/support/text/key.h: a named, typed and ranged value of a job, part, filling or printer.
//
// A table of keys is the single source of options, files, --set, messages, help and canonical text.
// Helpers make the rows of a table from a member:
//
//   field<&Job::heights, &HeightsRequest::cusp_mm>({"heights", "cusp_mm", "--cusp", "MM", "highest step"}, {0, 10, " mm"})
//   word<kModes, &Job::heights, &HeightsRequest::mode>({"heights", "mode", "--heights", "MODE", "how layers are decided"})
#pragma once

#include <algorithm>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "stages/support/text/changes.h"
#include "stages/support/text/toml.h"
#include "stages/support/text/value.h"

namespace lamina {

/// The fields independent of the target's type.
struct KeyName {
  std::string_view section, name;               // of the file
  std::string_view flag = {};                   // option with the same meaning; empty if there is none
  std::string_view value = {};                  // placeholder after the option: "MM", "WIDTHxDEPTH"; empty for a switch
  std::string_view meaning = {};                // for the help, one line
  unsigned decides = 0;                         // products whose bytes depend on it (job/product.h)
  std::string_view switch_text = {};            // value of a flag without text, as in --no-repair: "false"
  std::optional<std::string_view> unsaid = {};  // default that kept texts leave out
};

/// The form of a value in TOML; kToml: its text is TOML already.
enum class Form : std::uint8_t { kBare, kString, kList, kStrings, kToml };

/// Functions return "" or an error message to follow the key's name; on an error the target is unchanged.
template <class Target>
struct Key : KeyName {
  /// Reads the value from the text of an option; lists are separated by commas.
  std::string read(std::string_view text, Target& target) const { return read_text(*this, text, target); }
  /// Reads the value from a file. at  the place of an error
  std::string read(const TomlValue& tree, Target& target, TextPosition& at) const {
    if (read_tree != nullptr) return read_tree(*this, tree, target, at);
    const auto text = flat_text(tree);
    return text ? read_text(*this, *text, target) : "is not a single value or a list of them";
  }
  /// The value as text for read(); "" if unset.
  std::string write(const Target& target) const {
    return shown != nullptr && !shown(target) ? std::string() : write_text(*this, target);
  }
  /// Checks that read() could produce the value: compares numbers with their limits, and reads texts.
  std::string check(const Target& target) const { return check_target(*this, target); }
  void copy(const Target& from, Target& to) const { copy_value(*this, from, to); }

  /// The words that it takes, for completion.
  constexpr Key with_words(std::vector<std::string_view> (*all)()) const { return with(&Key::words, all); }
  /// The default of optional equipment: kept texts leave the key out at this value.
  constexpr Key unsaid_at(std::string_view same) const { return with(&Key::unsaid, same); }
  constexpr Key with_form(Form other) const { return with(&Key::form, other); }
  constexpr Key shown_if(bool (*condition)(const Target&)) const { return with(&Key::shown, condition); }
  /// The key with another value of one of its fields.
  template <class Class, class Value>
  constexpr Key with(Value Class::*which, std::type_identity_t<Value> other) const {
    Key key = *this;
    key.*which = other;
    return key;
  }

  Form form = Form::kBare;
  Limits limits = {};
  const void* inner = nullptr;  // the key of a member's table
  std::string (*read_text)(const Key&, std::string_view, Target&) = nullptr;
  std::string (*read_tree)(const Key&, const TomlValue&, Target&, TextPosition&) = nullptr;
  std::string (*write_text)(const Key&, const Target&) = nullptr;
  std::string (*check_target)(const Key&, const Target&) = nullptr;
  void (*copy_value)(const Key&, const Target&, Target&) = nullptr;
  bool (*shown)(const Target&) = nullptr;              // whether the value is written; always if null
  std::vector<std::string_view> (*words)() = nullptr;  // of static storage; null if it takes other values
};

/// The member of a target at the end of a path of members; the target itself if the path is empty.
template <auto... Path, class Target>
auto& member(Target& target) {
  if constexpr (sizeof...(Path) == 0) {
    return target;
  } else {
    return [&]<auto First, auto... Rest>()->auto& { return member<Rest...>(target.*First); }
    .template operator()<Path...>();
  }
}

namespace key_detail {

template <auto First, auto...>
struct Root;
template <class Class, class Value, Value Class::*First, auto... Rest>
struct Root<First, Rest...> {
  using Target = Class;
};
template <auto... Path>
using TargetOf = typename Root<Path...>::Target;
template <auto... Path>
using ValueOf = std::remove_cvref_t<decltype(member<Path...>(std::declval<TargetOf<Path...>&>()))>;

template <class Value>
inline constexpr Form kForm = Form::kBare;
template <class T, std::size_t N>
inline constexpr Form kForm<std::array<T, N>> = Form::kList;
template <class T>
inline constexpr Form kForm<std::vector<T>> = Form::kList;
template <class T>
inline constexpr Form kForm<std::optional<T>> = kForm<T>;

template <class Target, auto... Path>
constexpr Key<Target> begin(const KeyName& name, Form form, const Limits& limits = {}) {
  Key<Target> key;
  static_cast<KeyName&>(key) = name;
  key.form = form;
  key.limits = limits;
  key.copy_value = [](const Key<Target>&, const Target& from, Target& to) { member<Path...>(to) = member<Path...>(from); };
  return key;
}

template <class Inner, class Target>
const Key<Inner>& inner_of(const Key<Target>& key) {
  return *static_cast<const Key<Inner>*>(key.inner);
}

}  // namespace key_detail

/// A number, a switch, or a list of numbers.
template <auto... Path>
constexpr auto field(const KeyName& name, const Limits& limits = {}) {
  auto key =
      key_detail::begin<key_detail::TargetOf<Path...>, Path...>(name, key_detail::kForm<key_detail::ValueOf<Path...>>, limits);
  key.read_text = [](const auto& self, std::string_view text, auto& target) {
    return read_value(text, self.limits, member<Path...>(target));
  };
  key.write_text = [](const auto&, const auto& target) { return value_text(member<Path...>(target)); };
  key.check_target = [](const auto& self, const auto& target) { return check_value(member<Path...>(target), self.limits); };
  return key;
}

/// A word of a fixed list.
template <const auto& Words, auto... Path>
constexpr auto word(const KeyName& name) {
  auto key = key_detail::begin<key_detail::TargetOf<Path...>, Path...>(name, Form::kString);
  key.read_text = [](const auto&, std::string_view text, auto& target) {
    return read_word(Words, text, member<Path...>(target));
  };
  key.write_text = [](const auto&, const auto& target) { return write_word(Words, member<Path...>(target)); };
  key.check_target = [](const auto& self, const auto& target) {
    return std::string(self.write_text(self, target).empty() ? "is not one of its values" : "");
  };
  key.words = [] { return words_of(Words); };
  return key;
}

/// A value with custom functions: std::string Read(std::string_view, Value&) and
/// std::string Write(const Value&). Without a path the value is the whole target.
template <class Target, auto Read, auto Write, auto... Path>
constexpr Key<Target> custom(const KeyName& name, Form form) {
  auto key = key_detail::begin<Target, Path...>(name, form);
  key.read_text = [](const auto&, std::string_view text, auto& target) -> std::string {
    return Read(text, member<Path...>(target));
  };
  key.write_text = [](const auto&, const auto& target) -> std::string { return Write(member<Path...>(target)); };
  key.check_target = [](const auto&, const auto& target) -> std::string {
    const std::string text = Write(member<Path...>(target));
    auto copy = member<Path...>(target);
    return text.empty() ? std::string() : std::string(Read(text, copy));
  };
  return key;
}

/// A text accepted by Check(std::string_view).
template <auto Check, auto... Path>
constexpr auto text(const KeyName& name) {
  constexpr auto read = [](std::string_view given, std::string& value) {
    std::string wrong = Check(given);
    if (wrong.empty()) value = given;
    return wrong;
  };
  constexpr auto write = [](const std::string& value) { return value; };
  return custom<key_detail::TargetOf<Path...>, read, write, Path...>(name, Form::kString);
}

/// A structure: std::string Read(const TomlValue&, Value&, TextPosition&), and Write(const Value&) gives TOML of one value.
template <auto Read, auto Write, auto... Path>
constexpr auto structure(const KeyName& name) {
  auto key = key_detail::begin<key_detail::TargetOf<Path...>, Path...>(name, Form::kToml);
  key.read_tree = [](const auto&, const TomlValue& tree, auto& target, TextPosition& at) -> std::string {
    return Read(tree, member<Path...>(target), at);
  };
  key.read_text = [](const auto& self, std::string_view text, auto& target) -> std::string {
    TextPosition unused;
    const auto tree = read_toml_value(text);
    return self.read_tree(self, tree ? *tree : TomlValue{TomlValue::Kind::kText, std::string(text), {}, {}, {}}, target,
                          unused);
  };
  key.write_text = [](const auto&, const auto& target) -> std::string { return Write(member<Path...>(target)); };
  key.check_target = [](const auto& self, const auto& target) -> std::string {
    const std::string text = self.write(target);
    auto copy = target;
    return text.empty() ? std::string() : self.read(text, copy);
  };
  return key;
}

/// A key of a member's table as a key of the target; the member's table must outlive it.
template <auto... Path, class Inner>
auto inside(const Key<Inner>& inner, std::string_view section, unsigned decides) {
  auto key = key_detail::begin<key_detail::TargetOf<Path...>, Path...>(inner, inner.form, inner.limits);
  key.section = section;
  key.decides = decides;
  key.inner = &inner;
  key.words = inner.words;
  key.read_text = [](const auto& self, std::string_view text, auto& target) {
    return key_detail::inner_of<Inner>(self).read(text, member<Path...>(target));
  };
  key.read_tree = [](const auto& self, const TomlValue& tree, auto& target, TextPosition& at) {
    return key_detail::inner_of<Inner>(self).read(tree, member<Path...>(target), at);
  };
  key.write_text = [](const auto& self, const auto& target) {
    return key_detail::inner_of<Inner>(self).write(member<Path...>(target));
  };
  key.check_target = [](const auto& self, const auto& target) {
    return key_detail::inner_of<Inner>(self).check(member<Path...>(target));
  };
  key.copy_value = [](const auto& self, const auto& from, auto& to) {
    key_detail::inner_of<Inner>(self).copy(member<Path...>(from), member<Path...>(to));
  };
  return key;
}

// --- tables of keys

/// The message for an unknown name: the nearest key, or all keys of the section.
std::string no_such_key(std::string_view section, std::string_view name, std::span<const std::string_view> names);
std::string no_such_section(std::string_view section, std::span<const std::string_view> names);

template <class Target>
std::vector<std::string_view> section_names(std::span<const Key<Target>> keys) {
  std::vector<std::string_view> names;
  for (const auto& key : keys) {
    if (names.empty() || names.back() != key.section) names.push_back(key.section);
  }
  return names;
}

/// The key, or null with the message for its name.
template <class Target>
const Key<Target>* find_key(std::span<const Key<Target>> keys, std::string_view section, std::string_view name,
                            std::string& wrong) {
  std::vector<std::string_view> names;
  for (const auto& key : keys) {
    if (key.section != section) continue;
    if (key.name == name) return &key;
    names.push_back(key.name);
  }
  wrong = no_such_key(section, name, names);
  return nullptr;
}

/// Reads a table's values for a section's keys. returns "" or an error, "name: what"; at  its place
/// read  receives the index of each key read, unless null
template <class Target>
std::string read_table(const TomlValue& table, std::string_view section, std::span<const Key<Target>> keys, Target& target,
                       TextPosition& at, std::vector<std::size_t>* read = nullptr) {
  for (std::size_t i = 0; i < table.value.size(); ++i) {
    at = table.value[i].position;
    std::string wrong;
    const auto* key = find_key(keys, section, table.name[i], wrong);
    if (key != nullptr) wrong = key->read(table.value[i], target, at);
    if (!wrong.empty()) return fmt::format("{}: {}", table.name[i], wrong);
    if (read != nullptr) read->push_back(static_cast<std::size_t>(key - keys.data()));
  }
  return {};
}

/// Reads a file of sections. file  its name in messages
/// errors  kUsage: place, section and key, reason
template <class Target>
Status read_section(const TomlValue& table, std::string_view section, const std::string& file,
                    std::span<const Key<Target>> keys, Target& target) {
  const auto refuse = [&](const TextPosition& at, const std::string& what) {
    return Error{Fault::kUsage, fmt::format("{}{}", at.text(file), what)};
  };
  const auto names = section_names(keys);
  bool known = false;
  for (const std::string_view name : names) known = known || name == section;
  if (!known) return refuse(table.position, fmt::format("{}: {}", section, no_such_section(section, names)));
  if (!table.is_table()) return refuse(table.position, fmt::format("{} is a section; write [{}]", section, section));
  TextPosition at;
  const std::string wrong = read_table(table, section, keys, target, at);
  return wrong.empty() ? Status() : refuse(at, fmt::format("{}.{}", section, wrong));
}

/// "name = value" in TOML, without a line break.
std::string key_line(std::string_view name, Form form, std::string_view text);

/// The sections of a file with the values selected by keep(key, text).
template <class Target, class Keep>
std::string sections_text(std::span<const Key<Target>> keys, const Target& target, const Keep& keep) {
  std::string text;
  std::string_view section;
  for (const auto& key : keys) {
    const std::string value = key.write(target);
    if (!keep(key, value)) continue;
    if (section != key.section) text += fmt::format("{}[{}]\n", section.empty() ? "" : "\n", key.section);
    section = key.section;
    text += key_line(key.name, key.form, value) + "\n";
  }
  return text;
}

// --- changes of keys, with or without a range of heights.

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
