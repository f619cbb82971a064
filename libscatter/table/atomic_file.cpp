#include <scatter/optics/errors.hpp>
#include <scatter/table/atomic_file.hpp>
#include <scatter/table/files.hpp>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <mutex>

namespace scatter::table {
namespace fs = std::filesystem;

namespace {

// Names of the open parts where a signal handler can read them: fixed memory, one atomic flag each.
struct Slot {
  enum State { unused, being_filled, in_use };
  std::atomic<int> state{unused};
  std::array<char, 4096> path{};
};
std::array<Slot, 64> slots;
std::mutex slots_mutex; // among writers; the signal handler only reads
static_assert(std::atomic<int>::is_always_lock_free);

int register_part(const std::string& path) {
  if (path.size() >= slots[0].path.size()) throw InputError(fmt::format("{}: the path is too long", path));
  for (std::size_t i = 0; i < slots.size(); ++i) {
    int expected = Slot::unused;
    if (!slots[i].state.compare_exchange_strong(expected, Slot::being_filled)) continue;
    std::memcpy(slots[i].path.data(), path.c_str(), path.size() + 1);
    slots[i].state = Slot::in_use;
    return static_cast<int>(i);
  }
  throw RunError(fmt::format("cannot write {}: {} files are being written already", path, slots.size()));
}

bool is_registered(const std::string& path) {
  for (const Slot& slot : slots)
    if (slot.state == Slot::in_use && path == slot.path.data()) return true;
  return false;
}

fs::path folder_of(const fs::path& path) {
  return path.has_parent_path() ? path.parent_path() : fs::path(".");
}

} // namespace

void remove_unfinished_files() noexcept {
  for (const Slot& slot : slots)
    if (slot.state == Slot::in_use) ::unlink(slot.path.data());
}

std::string bytes_in_words(double bytes) {
  if (bytes >= 1e9) return fmt::format("{:.1f} GB", bytes / 1e9);
  if (bytes >= 1e6) return fmt::format("{:.1f} MB", bytes / 1e6);
  if (bytes >= 1e3) return fmt::format("{:.1f} kB", bytes / 1e3);
  return fmt::format("{:.0f} bytes", bytes);
}

double free_disk_bytes(const fs::path& path) {
  struct statvfs info {};
  if (::statvfs(folder_of(path).c_str(), &info) != 0) return 0;
  // The blocks kept for the administrator count only for the administrator.
  const auto blocks = ::geteuid() == 0 ? info.f_bfree : info.f_bavail;
  return static_cast<double>(blocks) * static_cast<double>(info.f_frsize);
}

std::string disk_error(const fs::path& name, int error) {
  if (error == ENOSPC || error == EDQUOT)
    return fmt::format(
        "cannot write {}: the disk is full ({} free)", name.string(), bytes_in_words(free_disk_bytes(name)));
  return fmt::format("cannot write {}: {}", name.string(), std::strerror(error));
}

PartFile::PartFile(const fs::path& target) : name_(target) {
  std::error_code error;
  const std::scoped_lock lock(slots_mutex);
  // A link is followed, so that the link stays and its target is replaced.
  target_ = fs::is_symlink(target, error) ? fs::weakly_canonical(target, error) : fs::absolute(target, error);
  if (error) throw InputError(fmt::format("cannot write {}: {}", target.string(), error.message()));
  const fs::file_status status = fs::status(target_, error);
  if (fs::is_directory(status))
    throw InputError(fmt::format("cannot write {}: it is a folder; name a file", target.string()));
  if (fs::exists(status) && !fs::is_regular_file(status))
    throw InputError(fmt::format("cannot write {}: it is not a regular file", target.string()));
  const fs::path folder = folder_of(target_);
  if (!fs::is_directory(folder, error) && error != std::errc::permission_denied)
    throw InputError(fmt::format(
        "cannot write {}: there is no folder {}; create it first", target.string(), folder.string()));

  for (int n = 0; descriptor_ < 0; ++n) {
    part_ = target_;
    part_ += fmt::format(".part-{}{}", ::getpid(), n == 0 ? "" : fmt::format("-{}", n));
    if (is_registered(part_.string())) continue;
    // A part of the same name that we do not write was left by a killed process that had our number.
    if (n == 0) ::unlink(part_.c_str());
    slot_ = register_part(part_.string());
    descriptor_ = ::open(part_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (descriptor_ >= 0) break;
    const int reason = errno;
    slots[static_cast<std::size_t>(slot_)].state = Slot::unused;
    if (reason != EEXIST) throw RunError(disk_error(target, reason));
  }
}

PartFile::~PartFile() {
  if (descriptor_ >= 0) {
    // A library that failed to close the file would hold its space otherwise; an error here is one of many
    // already.
    [[maybe_unused]] const int ignored = ::ftruncate(descriptor_, 0);
    ::close(descriptor_);
    ::unlink(part_.c_str());
  }
  if (slot_ >= 0) slots[static_cast<std::size_t>(slot_)].state = Slot::unused;
}

void PartFile::commit() {
  if (::fsync(descriptor_) != 0) throw RunError(disk_error(name_, errno));
  if (::rename(part_.c_str(), target_.c_str()) != 0) throw RunError(disk_error(name_, errno));
  ::close(descriptor_);
  descriptor_ = -1;
  // The name itself is durable once the folder is; some file systems cannot sync folders, which is no
  // failure.
  const int folder = ::open(folder_of(target_).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (folder >= 0) {
    ::fsync(folder);
    ::close(folder);
  }
}

void FileWriter::flush() {
  if (error_ != 0) throw RunError(disk_error(name_, error_));
  const char* at = buffer_.data();
  std::size_t left = buffer_.size();
  while (left > 0) {
    const ssize_t done = ::write(descriptor_, at, left);
    if (done < 0 && errno == EINTR) continue;
    if (done <= 0) {
      error_ = done < 0 ? errno : ENOSPC;
      throw RunError(disk_error(name_, error_));
    }
    at += done;
    left -= static_cast<std::size_t>(done);
  }
  flushed_ += buffer_.size();
  buffer_.clear();
}

void FileWriter::write(std::string_view bytes) {
  constexpr std::size_t capacity = 1 << 20;
  buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
  if (buffer_.size() >= capacity) flush();
}

void FileWriter::seek(std::size_t position) {
  flush();
  if (::lseek(descriptor_, static_cast<off_t>(position), SEEK_SET) < 0) {
    error_ = errno;
    throw RunError(disk_error(name_, error_));
  }
  flushed_ = position;
}

} // namespace scatter::table
