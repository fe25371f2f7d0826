#include "stages/write/bring.h"

#include <fmt/format.h>

#include <filesystem>

#include "stages/write/leftovers.h"
#include "stages/write/temporary.h"

namespace lamina::write {

Result<bool> bring_file(const std::string& from, const std::string& to) {
  namespace fs = std::filesystem;
  const std::string fresh = temporary_name(to);
  const int watched = watch(fresh.c_str());
  std::error_code error;
  fs::create_hard_link(from, fresh, error);
  const bool linked = !error;
  if (!linked) fs::copy_file(from, fresh, error);
  if (!error) fs::rename(fresh, to, error);
  remove_or_note(fresh);  // stays if `to` was a name of the same file already, and after an error
  forget(watched);
  if (error) return Error{Fault::kOutput, fmt::format("{}: {}", to, error.message())};
  return linked;
}

}  // namespace lamina::write
