// pipeline/nest/csv_rows.h: the cells of CSV text with their positions (Y. Shafranovich, RFC 4180, 2005).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/status.h"

namespace lamina::pipeline {

/// A cell and where it begins, both from 1.
struct CsvCell {
  std::string text;  // without quotes and the spaces around it
  std::uint32_t line = 1, column = 1;
};

/// Divides text into rows of cells.
class CsvRows {
 public:
  /// text  outlives this object
  CsvRows(std::string_view text, char separator) : text_(text), separator_(separator) {}

  /// The next row that is not empty; false at the end. fault  an opening quote without a closing one
  bool next(std::vector<CsvCell>& cells, std::optional<CsvCell>& fault);

 private:
  void step();
  bool at_end_of_line() const { return at_ == text_.size() || text_[at_] == '\n' || text_.substr(at_, 2) == "\r\n"; }
  void end_line();
  CsvCell cell(std::optional<CsvCell>& fault);

  std::string_view text_;
  char separator_;
  std::size_t at_ = 0;
  std::uint32_t line_ = 1, column_ = 1;
};

/// The text of a file, without a byte order mark of UTF-8. errors  kInput: it cannot be read, or is larger than 64 MiB
Result<std::string> csv_content(const std::string& path);

/// The cells of a file with commas. errors  kInput: it cannot be read, or a quote is not closed
Result<std::vector<std::vector<std::string>>> read_csv(const std::string& path);

}  // namespace lamina::pipeline
