// stages/load/text.h: words, numbers and windows of text files, and how messages quote them; internal to load.
#pragma once

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>

#include "stages/data/buffer.h"
#include "stages/load/source.h"

namespace lamina::load {

struct ModelObject;
struct ModelPackage;

inline bool is_line_end(char c) { return c == '\n' || c == '\r'; }
/// ^Z, the end of a text in DOS, counts too.
inline bool is_space(char c) { return c == ' ' || (c >= '\t' && c <= '\r') || c == '\0' || c == '\x1a'; }

/// Whether a word is `lower_case`, in any case.
inline bool is_word(std::string_view word, std::string_view lower_case) {
  return word.size() == lower_case.size() && std::equal(word.begin(), word.end(), lower_case.begin(), [](char c, char low) {
           return (c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c) == low;
         });
}

/// A number in double precision, in any locale. What is too large, or is one of the ways in which programs print
/// "not a number", is not finite; what is too small is 0. False if the word is no number at all.
inline bool parse_number(std::string_view word, double& value) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  const auto [end, status] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (word.empty() || status == std::errc::invalid_argument) return false;
  const std::string_view rest = word.substr(static_cast<std::size_t>(end - word.data()));
  if (!rest.empty() && rest.front() != '#') return false;
  if (!rest.empty()) {
    value = std::numeric_limits<double>::quiet_NaN();  // 1.#QNAN, 1.#INF of old Windows libraries
  } else if (status == std::errc::result_out_of_range) {
    const bool small = word.find("e-") != word.npos || word.find("E-") != word.npos;
    value = small ? 0.0 : std::numeric_limits<double>::infinity();
  }
  return true;
}

/// The line, from 1, that holds a byte. Reads the file again up to there: only errors need it.
std::uint64_t line_of(const Source& source, std::uint64_t offset);

/// A word of the file for messages: short, and without bytes that a terminal would act on.
std::string quoted(std::string_view word);

/// What is wrong with a word that is no number: "'1,5' has a decimal comma; ..." or "'x' is not a number".
std::string not_a_number(std::string_view word);

/// An extension of 3MF by its namespace: "beam lattice (http://...)", or the namespace alone where it has no known name.
std::string extension_label(std::string_view space);

/// An object of a package: "object 3 "cap"", or with its file where that is not the first one.
std::string label(const ModelPackage& package, const ModelObject& object);

/// Gives a text to `handle(begin, end, offset of begin)` window by window, each cut where `cut(begin, end)` says: how
/// many bytes, from the beginning, can be handled alone; 0 requests a larger window. A byte order mark is left out.
/// errors  those of `handle`; kInput if nothing can be cut off within 256 MiB
template <class Cut, class Handle>
Status for_each_window(const Source& source, std::size_t window, const Cut& cut, const Handle& handle) {
  constexpr std::size_t kLargest = std::size_t{256} << 20;
  std::array<char, 3> mark;
  std::uint64_t offset = source.head(mark) == "\xef\xbb\xbf" ? 3 : 0;
  Buffer<char> text;
  while (offset < source.size()) {
    const std::uint64_t left = source.size() - offset;
    text.resize(static_cast<std::size_t>(std::min<std::uint64_t>(window, left)));
    if (!source.read(offset, text.data(), text.size())) return source.changed_while_read();
    const char* const begin = text.data();
    const std::size_t usable = text.size() == left ? text.size() : cut(begin, begin + text.size());
    if (usable == 0) {
      if (window >= kLargest) return source.error("has no line or facet end within 256 MiB; it is no part file");
      window *= 2;
      continue;
    }
    if (const Status handled = handle(begin, begin + usable, offset); !handled) return handled;
    offset += usable;
  }
  return {};
}

}  // namespace lamina::load
