#include "stages/support/text/json_value.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

namespace lamina {
namespace {

using Tree = nlohmann::ordered_json;

constexpr std::string_view kKinds[] = {"null",     "a truth value", "a whole number", "a whole number",
                                       "a number", "text",          "a list",         "an object"};

}  // namespace

/// Conversion to and from the library's tree.
struct JsonText {
  static Tree tree_of(const Json& value) {
    const auto convert = [](const auto& held) -> Tree {
      using Held = std::decay_t<decltype(held)>;
      if constexpr (std::same_as<Held, Json::List>) {
        Tree list = Tree::array();
        for (const Json& element : held) list.push_back(tree_of(element));
        return list;
      } else if constexpr (std::same_as<Held, Json::Members>) {
        Tree object = Tree::object();
        for (const Json::Member& member : held) object.emplace(member.name, tree_of(member.value));
        return object;
      } else {
        return held;
      }
    };
    return std::visit(convert, value.value_);
  }

  static Json value_of(const Tree& tree) {
    switch (tree.type()) {
      case Tree::value_t::boolean: return tree.get<bool>();
      case Tree::value_t::number_integer: return tree.get<std::int64_t>();
      case Tree::value_t::number_unsigned: return tree.get<std::uint64_t>();
      case Tree::value_t::number_float: return tree.get<double>();
      case Tree::value_t::string: return tree.get_ref<const std::string&>();
      case Tree::value_t::array: {
        Json list = Json::array();
        for (const Tree& element : tree) list.push_back(value_of(element));
        return list;
      }
      case Tree::value_t::object: {
        Json object = Json::object();
        for (const auto& [name, value] : tree.items()) object[name] = value_of(value);
        return object;
      }
      default: return {};
    }
  }
};

Json::Json() = default;
Json::Json(const Json&) = default;
Json::Json(Json&&) noexcept = default;
Json& Json::operator=(const Json&) = default;
Json& Json::operator=(Json&&) noexcept = default;
Json::~Json() = default;

Json::Json(std::string text) : value_(std::move(text)) {}

Json::Json(Scalar scalar) {
  std::visit([this](auto number) { value_ = number; }, scalar);
}

Json::Json(std::initializer_list<Json> elements) {
  const auto is_member = [](const Json& element) {
    const List* pair = std::get_if<List>(&element.value_);
    return pair != nullptr && pair->size() == 2 && pair->front().is_string();
  };
  if (!std::ranges::all_of(elements, is_member)) {
    value_ = List(elements);
    return;
  }
  value_ = Members();
  for (const Json& element : elements) (*this)[element.front().text()] = element.at(std::size_t{1});
}

Json Json::array(std::initializer_list<Json> elements) {
  Json list;
  list.value_ = List(elements);
  return list;
}

Json Json::object() {
  Json object;
  object.value_ = Members();
  return object;
}

bool Json::is_null() const { return std::holds_alternative<std::nullptr_t>(value_); }
bool Json::is_object() const { return std::holds_alternative<Members>(value_); }
bool Json::is_string() const { return std::holds_alternative<std::string>(value_); }

bool Json::is_number_unsigned() const {
  const auto* number = std::get_if<std::int64_t>(&value_);
  return std::holds_alternative<std::uint64_t>(value_) || (number != nullptr && *number >= 0);
}

bool Json::has_fraction() const {
  return std::holds_alternative<double>(value_) ||
         std::any_of(begin(), end(), [](const Json& element) { return element.has_fraction(); }) ||
         std::ranges::any_of(members(), [](const Member& member) { return member.value.has_fraction(); });
}

bool Json::operator==(const Json& other) const { return JsonText::tree_of(*this) == JsonText::tree_of(other); }

std::size_t Json::size() const {
  if (const List* list = std::get_if<List>(&value_)) return list->size();
  return members().size();
}

Json& Json::at(std::size_t index) { return const_cast<Json&>(std::as_const(*this).at(index)); }

const Json& Json::at(std::size_t index) const {
  const List& list = elements();
  if (index >= list.size()) throw JsonError(fmt::format("element {} does not exist", index));
  return list[index];
}

const Json* Json::begin() const {
  const List* list = std::get_if<List>(&value_);
  return list == nullptr ? nullptr : list->data();
}

const Json* Json::end() const { return begin() == nullptr ? nullptr : begin() + size(); }

Json& Json::emplace_back() {
  if (is_null()) value_ = List();
  List* list = std::get_if<List>(&value_);
  return list == nullptr ? (fail("a list"), *this) : list->emplace_back();
}

Json& Json::operator[](std::string_view name) {
  if (is_null()) value_ = Members();
  Members* members = std::get_if<Members>(&value_);
  if (members == nullptr) fail("an object");
  const auto found = std::ranges::find(*members, name, &Member::name);
  return found == members->end() ? members->emplace_back(Member{std::string(name), {}}).value : found->value;
}

const Json& Json::at(std::string_view name) const {
  if (!is_object()) fail("an object");
  const Json* found = find(name);
  if (found == nullptr) throw JsonError(fmt::format("\"{}\" does not exist", name));
  return *found;
}

const Json* Json::find(std::string_view name) const {
  const auto found = std::ranges::find(members(), name, &Member::name);
  return found == members().end() ? nullptr : &found->value;
}

const std::vector<Json::Member>& Json::members() const {
  static const Members kNone;
  const Members* members = std::get_if<Members>(&value_);
  return members == nullptr ? kNone : *members;
}

void Json::update(const Json& other) {
  if (!other.is_object()) other.fail("an object");
  for (const Member& member : other.members()) (*this)[member.name] = member.value;
}

void Json::erase(std::string_view name) {
  if (Members* members = std::get_if<Members>(&value_))
    std::erase_if(*members, [&](const Member& member) { return member.name == name; });
}

template <class Held>
const Held& Json::held(std::string_view expected) const {
  const Held* value = std::get_if<Held>(&value_);
  if (value == nullptr) fail(expected);
  return *value;
}

const std::string& Json::text() const { return held<std::string>("text"); }
bool Json::boolean() const { return held<bool>("a truth value"); }
const Json::List& Json::elements() const { return held<List>("a list"); }

std::int64_t Json::whole() const {
  if (const auto* number = std::get_if<std::uint64_t>(&value_)) return static_cast<std::int64_t>(*number);
  const auto* number = std::get_if<double>(&value_);
  if (number != nullptr && *number >= -0x1p63 && *number < 0x1p63) return static_cast<std::int64_t>(*number);
  return held<std::int64_t>("a whole number");
}

double Json::number() const {
  if (const auto* number = std::get_if<std::int64_t>(&value_)) return static_cast<double>(*number);
  if (const auto* number = std::get_if<std::uint64_t>(&value_)) return static_cast<double>(*number);
  return held<double>("a number");
}

void Json::fail(std::string_view expected) const {
  throw JsonError(fmt::format("{} instead of {}", kKinds[value_.index()], expected));
}

std::string json_text(const Json& value, int indent) {
  return JsonText::tree_of(value).dump(indent, ' ', false, Tree::error_handler_t::replace);
}

std::string json_line(const Json& value, int indent) { return json_text(value, indent) + "\n"; }

Json parse_json(std::string_view text) {
  try {
    return JsonText::value_of(Tree::parse(text));
  } catch (const Tree::exception& error) {
    throw JsonError(error.what());
  }
}

}  // namespace lamina
