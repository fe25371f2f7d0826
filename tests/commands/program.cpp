#include "tests/commands/program.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>

namespace lamina::test {

namespace fs = std::filesystem;

Directory::Directory() {
  std::string name = (fs::temp_directory_path() / "lamina-test-XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary directory");
  path_ = name;
}

Directory::~Directory() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

std::size_t Outcome::error_lines() const { return static_cast<std::size_t>(std::ranges::count(err, '\n')); }

Outcome run_lamina(const std::vector<std::string>& arguments, const fs::path& directory,
                   const std::function<void(int)>& watch) {
  const Directory streams;
  const std::string out = streams / "out", err = streams / "err";
  std::vector<std::string> texts = {LAMINA_PROGRAM};
  texts.insert(texts.end(), arguments.begin(), arguments.end());
  std::vector<char*> pointers;
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);

  const pid_t child = ::fork();
  if (child == 0) {
    const int out_file = ::open(out.c_str(), O_WRONLY | O_CREAT, 0600),
              err_file = ::open(err.c_str(), O_WRONLY | O_CREAT, 0600);
    ::dup2(out_file, 1);
    ::dup2(err_file, 2);
    if (::chdir(directory.c_str()) == 0) ::execv(pointers[0], pointers.data());
    ::_exit(127);
  }
  if (watch) watch(child);
  int status = 0;
  ::waitpid(child, &status, 0);
  Outcome outcome;
  outcome.code = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
  outcome.out = read_text(out);
  outcome.err = read_text(err);
  return outcome;
}

std::vector<std::string> words_of(const std::string& line) {
  std::istringstream stream(line);
  return {std::istream_iterator<std::string>(stream), {}};
}

void expect_refused(const std::string& line, int code, const std::string& words, const Directory& directory) {
  const std::string before = tree_text(directory.path());
  const Outcome outcome = run_lamina(words_of(line), directory.path());
  EXPECT_EQ(outcome.code, code) << line << "\n" << outcome.err;
  EXPECT_EQ(outcome.error_lines(), 1u) << line << "\n" << outcome.err;
  EXPECT_NE(outcome.err.find(words), std::string::npos) << line << "\n" << outcome.err;
  EXPECT_TRUE(tree_text(directory.path()) == before) << line;
}

void write_one_of_each_kind(const Directory& directory) {
  const fs::path tests = LAMINA_TEST_DIR;
  write_box(directory / "part.stl", {0, 0, 0}, {6, 4, 3});
  fs::copy(tests / "reference/dinisio2022/table_18.tsv", directory / "drops.csv");
  fs::copy(tests / ".." / "pipeline/machine/shipped/printers/hp45.toml", directory / "powder.toml");
  fs::copy(tests / ".." / "pipeline/machine/shipped/extruders/anet-a8.toml", directory / "printer.toml");
  write_text(directory / "job.toml", "[layers]\nthickness_mm = 1\n[[part]]\npath = \"part.stl\"\n");
  write_text(directory / "tops.txt", "1\n2\n3\n");
  write_text(directory / "widths.csv", "test,percent,thin_mm\nextrusion,90,0.3\n");
  write_text(directory / "list.txt", "info part.stl\n");
}

BrowserAnswer in_browser(const std::string& page, int layer) {
  const std::string command = "python3 '" + std::string(LAMINA_TEST_DIR) + "/report/browser.py' '" + page + "' " +
                              std::to_string(layer) + " 2>/dev/null";
  BrowserAnswer answer;
  std::FILE* pipe = ::popen(command.c_str(), "r");
  if (pipe == nullptr) return answer;
  std::array<char, 65536> piece{};
  for (std::size_t got = 0; (got = std::fread(piece.data(), 1, piece.size(), pipe)) > 0;) answer.json.append(piece.data(), got);
  answer.code = WEXITSTATUS(::pclose(pipe));
  return answer;
}

std::string corpus_file(std::string_view name) { return std::string(LAMINA_TEST_DIR) + "/corpus/" + std::string(name); }

std::string read_text(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void write_text(const fs::path& path, std::string_view text) { std::ofstream(path, std::ios::binary) << text; }

void write_box(const fs::path& path, const std::array<float, 3>& lo, const std::array<float, 3>& hi) {
  // Corner i has bit 0 for x, bit 1 for y, bit 2 for z.
  constexpr int kFaces[12][3] = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                                 {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  std::string bytes(80, ' ');
  const std::uint32_t count = 12;
  bytes.append(reinterpret_cast<const char*>(&count), 4);
  for (const auto& face : kFaces) {
    float numbers[12] = {};
    for (int k = 0; k < 3; ++k) {
      for (int axis = 0; axis < 3; ++axis) numbers[3 + 3 * k + axis] = (face[k] >> axis & 1 ? hi : lo)[axis];
    }
    bytes.append(reinterpret_cast<const char*>(numbers), sizeof numbers);
    bytes.append(2, '\0');
  }
  write_text(path, bytes);
}

std::vector<std::string> files_below(const fs::path& directory) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::recursive_directory_iterator entry(directory, error), end; !error && entry != end; entry.increment(error)) {
    if (entry->is_regular_file()) names.push_back(entry->path().lexically_relative(directory).string());
  }
  std::ranges::sort(names);
  return names;
}

std::string tree_text(const fs::path& directory) {
  std::string text;
  for (const std::string& name : files_below(directory)) text += name + "\n" + read_text(directory / name) + "\n";
  return text;
}

}  // namespace lamina::test
