#include "stages/support/text/part_name.h"

#include <algorithm>
#include <vector>

namespace lamina {
namespace {

int hexadecimal(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  return c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

std::string decoded(std::string_view name) {
  std::string out;
  for (std::size_t i = 0; i < name.size(); ++i) {
    const int high = name[i] == '%' && i + 2 < name.size() ? hexadecimal(name[i + 1]) : -1;
    const int low = high >= 0 ? hexadecimal(name[i + 2]) : -1;
    char c = name[i];
    if (low >= 0) c = static_cast<char>(16 * high + low), i += 2;
    out += c == '\\' ? '/' : c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  }
  return out;
}

}  // namespace

std::string part_name(std::string_view name, std::string_view folder) {
  std::string whole = decoded(name);
  if (!whole.starts_with('/')) whole.insert(0, folder);
  std::vector<std::string_view> folders;
  const std::string_view text = whole;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find('/', at), text.size());
    const std::string_view one = text.substr(at, end - at);
    if (one == ".." && !folders.empty()) folders.pop_back();
    if (!one.empty() && one != "." && one != "..") folders.push_back(one);
    at = end + 1;
  }
  std::string out;
  for (const std::string_view one : folders) (out += '/') += one;
  return out;
}

}  // namespace lamina
