#include "pipeline/nest/csv_rows.h"

#include <fmt/format.h>

#include <utility>

#include "stages/support/io/file_reader.h"

namespace lamina::pipeline {

bool CsvRows::next(std::vector<CsvCell>& cells, std::optional<CsvCell>& fault) {
  while (at_ < text_.size()) {
    cells.clear();
    do {
      cells.push_back(cell(fault));
    } while (at_ < text_.size() && text_[at_] == separator_ && (step(), true));
    end_line();
    if (cells.size() > 1 || !cells[0].text.empty()) return true;
  }
  return false;
}

void CsvRows::step() {
  if (text_[at_] == '\n') {
    ++line_;
    column_ = 0;
  }
  // Bytes that continue a character of UTF-8 are no columns.
  if ((static_cast<unsigned char>(text_[at_]) & 0xc0) != 0x80) ++column_;
  ++at_;
}

void CsvRows::end_line() {
  if (at_ < text_.size() && text_[at_] == '\r') step();
  if (at_ < text_.size()) {
    step();
    column_ = 1;
  }
}

CsvCell CsvRows::cell(std::optional<CsvCell>& fault) {
  CsvCell cell{{}, line_, column_};
  if (at_ < text_.size() && text_[at_] == '"') {
    step();
    for (;;) {
      if (at_ == text_.size()) {
        fault = cell;
        return cell;
      }
      if (text_[at_] == '"') {
        step();
        if (at_ == text_.size() || text_[at_] != '"') break;
      }
      cell.text += text_[at_];
      step();
    }
  }
  while (!at_end_of_line() && text_[at_] != separator_) {
    cell.text += text_[at_];
    step();
  }
  const auto first = cell.text.find_first_not_of(" \t"), last = cell.text.find_last_not_of(" \t");
  cell.text = first == std::string::npos ? std::string() : cell.text.substr(first, last - first + 1);
  return cell;
}

Result<std::string> csv_content(const std::string& path) {
  ReadRules rules;
  rules.fault = Fault::kInput;
  rules.max_bytes = kMaxTableBytes;
  auto file = FileReader::open(path, rules);
  if (!file) return file.error();
  const auto text = file->text();
  if (!text) return text.error();
  constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
  const std::string_view whole = *text;
  return std::string(whole.substr(whole.starts_with(kByteOrderMark) ? kByteOrderMark.size() : 0));
}

Result<std::vector<std::vector<std::string>>> read_csv(const std::string& path) {
  const auto text = csv_content(path);
  if (!text) return text.error();
  CsvRows rows(*text, ',');
  std::vector<std::vector<std::string>> table;
  std::vector<CsvCell> cells;
  std::optional<CsvCell> open;
  while (rows.next(cells, open)) {
    if (open) return Error{Fault::kInput, fmt::format("{}:{}:{}: a quote is not closed", path, open->line, open->column)};
    table.emplace_back();
    for (CsvCell& cell : cells) table.back().push_back(std::move(cell.text));
  }
  return table;
}

}  // namespace lamina::pipeline
