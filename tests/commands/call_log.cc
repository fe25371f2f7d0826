// tests/commands/call_log.cc: loaded before the program (LD_PRELOAD), logs what it syncs and renames, in order.
//
// LAMINA_CALL_LOG    the log: "fsync PATH", "syncfs PATH", "begin PATH" (sync_file_range), "rename FROM TO"
// LAMINA_FAIL_SYNC   syncs of paths that contain this text fail
// LAMINA_SYNC_ERRNO  with this error number
#include <dlfcn.h>
#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <string>

namespace {

std::string path_of(int file) {
  char path[4096];
  const ssize_t size = ::readlink(("/proc/self/fd/" + std::to_string(file)).c_str(), path, sizeof path);
  return size < 0 ? std::string("?") : std::string(path, static_cast<std::size_t>(size));
}

void log_line(const std::string& line) {
  const char* name = std::getenv("LAMINA_CALL_LOG");
  const int log = name == nullptr ? -1 : ::open(name, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0600);
  if (log < 0) return;
  const std::string text = line + "\n";
  if (::write(log, text.data(), text.size()) < 0) std::abort();
  ::close(log);
}

template <class Call, class... Arguments>
int pass_on(const char* name, Arguments... arguments) {
  return reinterpret_cast<Call*>(::dlsym(RTLD_NEXT, name))(arguments...);
}

int sync_call(const char* name, int file) {
  const std::string path = path_of(file);
  log_line(std::string(name) + " " + path);
  const char *failing = std::getenv("LAMINA_FAIL_SYNC"), *reason = std::getenv("LAMINA_SYNC_ERRNO");
  if (failing == nullptr || path.find(failing) == std::string::npos) return pass_on<int(int)>(name, file);
  errno = reason == nullptr ? EIO : std::atoi(reason);
  return -1;
}

}  // namespace

extern "C" {

int fsync(int file) { return sync_call("fsync", file); }
int fdatasync(int file) { return sync_call("fdatasync", file); }
int syncfs(int file) noexcept { return sync_call("syncfs", file); }

int sync_file_range(int file, off64_t offset, off64_t bytes, unsigned flags) {
  log_line("begin " + path_of(file));
  return pass_on<int(int, off64_t, off64_t, unsigned)>("sync_file_range", file, offset, bytes, flags);
}

int rename(const char* from, const char* to) noexcept {
  log_line(std::string("rename ") + from + " " + to);
  return pass_on<int(const char*, const char*)>("rename", from, to);
}

int renameat2(int from_folder, const char* from, int to_folder, const char* to, unsigned flags) noexcept {
  log_line(std::string("rename ") + from + " " + to);
  return pass_on<int(int, const char*, int, const char*, unsigned)>("renameat2", from_folder, from, to_folder, to, flags);
}

}  // extern "C"
