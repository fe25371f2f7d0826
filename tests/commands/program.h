// tests/commands/program.h: runs the real program in a directory of its own, and makes parts for it.
#pragma once

#include <array>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace lamina::test {

/// A fresh directory that is removed with all that is in it.
class Directory {
 public:
  Directory();
  ~Directory();
  Directory(const Directory&) = delete;
  Directory& operator=(const Directory&) = delete;
  std::string operator/(std::string_view name) const { return (path_ / name).string(); }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

struct Outcome {
  int code = -1;  // 128 + signal if one ended it
  std::string out, err;
  std::size_t error_lines() const;
};

/// Runs `lamina` with these arguments in `directory` and waits for it. `watch`, if given, is called with its process id
/// once it runs.
Outcome run_lamina(const std::vector<std::string>& arguments, const std::filesystem::path& directory,
                   const std::function<void(int)>& watch = {});

/// The arguments of a call, without quotes: what stands between blanks.
std::vector<std::string> words_of(const std::string& line);

/// The call ends with this code and one line that says `words`, and leaves every file of the directory as it is.
void expect_refused(const std::string& line, int code, const std::string& words, const Directory& directory);

/// One file of every kind that commands read: part.stl, drops.csv, powder.toml, printer.toml, job.toml, tops.txt, widths.csv,
/// list.txt.
void write_one_of_each_kind(const Directory& directory);

/// The path of a file of tests/corpus.
std::string corpus_file(std::string_view name);

/// What a page of lamina report says of itself in Chromium, with this layer chosen. code  kNoBrowser: there is none
constexpr int kNoBrowser = 77;
struct BrowserAnswer {
  int code = -1;
  std::string json;
};
BrowserAnswer in_browser(const std::string& page, int layer);

std::string read_text(const std::filesystem::path& path);
void write_text(const std::filesystem::path& path, std::string_view text);

/// A closed box in mm as a binary STL.
void write_box(const std::filesystem::path& path, const std::array<float, 3>& lo, const std::array<float, 3>& hi);

/// Names and contents of all regular files below a directory, in order, as one text to compare.
std::string tree_text(const std::filesystem::path& directory);

/// Names of all regular files below a directory, in order.
std::vector<std::string> files_below(const std::filesystem::path& directory);

}  // namespace lamina::test
