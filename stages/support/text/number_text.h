// stages/support/text/number_text.h: numbers in text: read strictly from options and job files, written for people and for
// G-code, and the cells of tables.
//
// The whole text must be one finite number: "12mm", "1e999", "nan" and "inf" are errors.
// Every reader returns an empty string, or an error with the valid form, to follow the option's name.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace lamina {

/// A number in [low, high]. `unit` is for the message only, as in " mm".
std::string read_number(std::string_view text, double low, double high, std::string_view unit, double& value);

/// A whole number in [low, high]; 600 and 600.0 are both whole.
std::string read_whole(std::string_view text, std::int64_t low, std::int64_t high, std::int64_t& value);

/// "; decimal numbers have a point, as 0.05" for a text with one comma between digits, else "".
std::string comma_hint(std::string_view text);
/// The message of a reader with the hint, if it has none.
std::string with_comma_hint(std::string wrong, std::string_view text);

/// true or false.
std::string read_switch(std::string_view text, bool& value);

/// Bytes: 1073741824, 256M, 1G, 1.5GiB; K, M and G are powers of 1024.
std::string read_bytes(std::string_view text, std::uint64_t& bytes);

/// Layers first:last, from 0, without last; either side may be missing. An open end is UINT32_MAX.
std::string read_layer_range(std::string_view text, std::array<std::uint32_t, 2>& range);

/// Shard i/n with i from 1 to n; `shard` holds i from 0.
std::string read_shard(std::string_view text, std::array<std::uint32_t, 2>& shard);

/// The parts of a text between any of `separators`; one empty part for an empty text.
std::vector<std::string_view> split(std::string_view text, std::string_view separators);

/// The text without the spaces around it.
std::string_view trimmed(std::string_view text);

/// The shortest text that reads back as the same number; never -0.
std::string number_text(double value);

// --- numbers of G-code: decimal, with a point, without an exponent.

/// mm with four digits (a tenth of a micrometre), never -0.
std::string mm_text(double millimetres);

/// A number with up to so many digits behind the point, and no exponent, which G-code does not know.
std::string plain_text(double value, int digits);

/// The least that is written of a roller's turns a minute, and of seconds to dry: a thousandth.
inline constexpr int kPlainDigits = 3;

/// mm a minute, as F words have it: whole ones but below 1, never 0.
std::string feed_text(double mm_s);

// --- lines of user-edited tables, separated by commas, semicolons or tabs.

/// The column separator of a table, detected from its first line.
char separator_of(std::string_view header);

/// The cells of a line without surrounding blanks and quotes.
std::vector<std::string> cells_of(std::string_view line, char separator);

}  // namespace lamina
