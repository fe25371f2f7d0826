// stages/support/text/json_value.h: a tree of values (null, bool, number, text, list, object), and its JSON text.
//
// Names keep the order in which they were added. No header of a JSON library is included: json_value.cpp alone does.
#pragma once

#include <concepts>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <ranges>
#include <stdexcept>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace lamina {

/// A value of another kind than expected, or a name or element that does not exist.
struct JsonError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

class Json {
 public:
  struct Member;  // name, value

  // --- conversions to a value
  Json();  // null
  Json(std::nullptr_t) : Json() {}
  template <std::integral T>
  Json(T number) : Json(Scalar(scalar_of(number))) {}
  template <std::floating_point T>
  Json(T number) : Json(Scalar(static_cast<double>(number))) {}
  Json(const char* text) : Json(std::string(text)) {}
  Json(std::string_view text) : Json(std::string(text)) {}
  Json(std::string text);
  /// Of elements that are values, such as std::vector<double>.
  template <std::ranges::input_range List>
  requires(!std::same_as<List, Json> && !std::convertible_to<const List&, std::string_view> &&
           std::convertible_to<std::ranges::range_reference_t<const List>, Json>) Json(const List& list)
      : Json(array()) {
    for (const auto& element : list) push_back(element);
  }
  /// An object if all elements are lists of two that begin with a text: {{"name", 1}, {"other", 2}}; else a list.
  Json(std::initializer_list<Json> elements);
  static Json array(std::initializer_list<Json> elements = {});
  static Json object();

  Json(const Json& other);
  Json(Json&& other) noexcept;
  Json& operator=(const Json& other);
  Json& operator=(Json&& other) noexcept;
  ~Json();

  bool is_null() const;
  bool is_object() const;
  bool is_string() const;
  bool is_number_unsigned() const;  // 0 or a positive whole number
  /// Whether it, or a value in it, is a number with a fraction, an exponent, or too large for 64 bits.
  bool has_fraction() const;
  bool operator==(const Json& other) const;

  // --- lists and objects; of other values size() is 0
  std::size_t size() const;
  bool empty() const { return size() == 0; }
  /// Element of a list. errors  throws JsonError
  Json& at(std::size_t index);
  const Json& at(std::size_t index) const;
  const Json& operator[](std::size_t index) const { return at(index); }
  const Json& front() const { return at(std::size_t{0}); }
  Json& back() { return at(size() - 1); }
  /// Elements of a list; none of another value.
  const Json* begin() const;
  const Json* end() const;
  /// To a list, or null, which becomes one. errors  throws JsonError
  void push_back(Json value) { emplace_back() = std::move(value); }
  Json& emplace_back();
  Json& emplace_back(Json value) { return emplace_back() = std::move(value); }

  /// Member of an object; added as null if the name is new. Null becomes an object. errors  throws JsonError
  Json& operator[](std::string_view name);
  /// errors  throws JsonError
  const Json& at(std::string_view name) const;
  const Json& operator[](std::string_view name) const { return at(name); }
  /// null  no object, or no such name
  const Json* find(std::string_view name) const;
  bool contains(std::string_view name) const { return find(name) != nullptr; }
  /// Members in their order; none of another value.
  const std::vector<Member>& members() const;
  /// Sets the members of another object.
  void update(const Json& other);
  void erase(std::string_view name);

  /// bool, whole numbers, double, std::string, or a std::vector of one; numbers are converted. errors  throws JsonError
  template <class T>
  T get() const {
    if constexpr (std::same_as<T, bool>) {
      return boolean();
    } else if constexpr (std::integral<T>) {
      return static_cast<T>(whole());
    } else if constexpr (std::floating_point<T>) {
      return static_cast<T>(number());
    } else if constexpr (std::same_as<T, std::string>) {
      return text();
    } else {
      T list;
      for (const Json& element : elements()) list.push_back(element.get<typename T::value_type>());
      return list;
    }
  }
  /// As get() of the target's type. errors  throws JsonError
  template <class T>
  void get_to(T& target) const {
    target = get<T>();
  }
  /// errors  throws JsonError
  const std::string& text() const;

 private:
  friend struct JsonText;
  using List = std::vector<Json>;
  using Members = std::vector<Member>;
  using Scalar = std::variant<bool, std::int64_t, std::uint64_t, double>;

  explicit Json(Scalar scalar);
  template <std::integral T>
  static Scalar scalar_of(T number) {
    if constexpr (std::same_as<T, bool>) {
      return number;
    } else if constexpr (std::is_signed_v<T>) {
      return std::int64_t{number};
    } else {
      return std::uint64_t{number};
    }
  }
  template <class Held>
  const Held& held(std::string_view expected) const;  // errors  throws JsonError: another kind than expected
  bool boolean() const;
  std::int64_t whole() const;  // of an unsigned number its bits
  double number() const;
  const List& elements() const;
  [[noreturn]] void fail(std::string_view expected) const;

  std::variant<std::nullptr_t, bool, std::int64_t, std::uint64_t, double, std::string, List, Members> value_;
};

struct Json::Member {
  std::string name;
  Json value;
};

/// JSON on one line or indented; bytes that are not UTF-8 become U+FFFD.
std::string json_text(const Json& value, int indent = -1);
/// The same with a final line end.
std::string json_line(const Json& value, int indent = -1);

/// errors  throws JsonError: not JSON. The text is not nested deeper than json_nests_within() allows
Json parse_json(std::string_view text);

}  // namespace lamina
