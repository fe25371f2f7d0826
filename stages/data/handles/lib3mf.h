// stages/data/handles/lib3mf.h: an object of lib3mf (1.8, C interface) that is released at its end. It lies here because the
// reader and the writer of 3MF are two stages.
#pragma once

#include <Model/COM/NMR_DLLInterfaces.h>

#include <string>
#include <utility>

namespace lamina {

class Lib3mfHandle {
 public:
  Lib3mfHandle() = default;
  Lib3mfHandle(Lib3mfHandle&& other) noexcept : pointer_(std::exchange(other.pointer_, nullptr)) {}
  Lib3mfHandle& operator=(Lib3mfHandle&&) = delete;
  ~Lib3mfHandle() {
    if (pointer_ != nullptr) NMR::lib3mf_release(pointer_);
  }
  NMR::PLib3MFBase* get() const { return pointer_; }
  NMR::PLib3MFBase** out() { return &pointer_; }

  /// Why the last call on it failed, in the library's words.
  std::string last_error() const {
    DWORD code = 0;
    LPCSTR message = nullptr;
    const bool known = pointer_ != nullptr && NMR::lib3mf_getlasterror(pointer_, &code, &message) == LIB3MF_OK;
    return known && message != nullptr ? message : "the library gives no reason";
  }

 private:
  NMR::PLib3MFBase* pointer_ = nullptr;
};

}  // namespace lamina
