#include "undistortion/image_ledger.h"

#include <algorithm>
#include <filesystem>
#include <sstream>

#include "cairn/base/error.h"
#include "cairn/base/file.h"

namespace cairn {
namespace {

std::string Line(const std::string& name, const ImageLedger::Entry& entry) {
  return entry.input_hash + " " + entry.file_hash + " " + name + "\n";
}

}  // namespace

ImageLedger::ImageLedger(const std::string& path) : path_(path) {
  if (!std::filesystem::exists(path)) return;
  std::istringstream text(ReadFile(path));
  Entry entry;
  std::string name;
  // The last line of a run that was killed may be torn; it names no image that is there.
  while (text >> entry.input_hash >> entry.file_hash && text.get() == ' ' &&
         std::getline(text, name)) {
    entries_.emplace(name, entry);
  }
}

bool ImageLedger::IsOurs(const std::string& name, const std::string& file_hash) const {
  const std::lock_guard lock(mutex_);
  const auto [begin, end] = entries_.equal_range(name);
  return std::any_of(begin, end, [&](const auto& of) { return of.second.file_hash == file_hash; });
}

bool ImageLedger::Has(const std::string& name, const Entry& entry) const {
  const std::lock_guard lock(mutex_);
  const auto [begin, end] = entries_.equal_range(name);
  return std::any_of(begin, end, [&](const auto& of) { return of.second == entry; });
}

void ImageLedger::Add(const std::string& name, const Entry& entry) {
  const std::lock_guard lock(mutex_);
  if (!file_.is_open()) {
    Write();  // without a torn line
    file_.open(path_, std::ios::app);
  }
  entries_.emplace(name, entry);
  file_ << Line(name, entry) << std::flush;
  if (!file_) throw IoError(path_, "cannot be written");
}

std::set<std::string> ImageLedger::Names() const {
  std::set<std::string> names;
  for (const auto& [name, entry] : entries_) names.insert(name);
  return names;
}

void ImageLedger::Keep(const std::map<std::string, Entry>& entries) {
  file_.close();
  entries_ = {entries.begin(), entries.end()};
  Write();
}

void ImageLedger::Write() {
  std::string text;
  for (const auto& [name, entry] : entries_) text += Line(name, entry);
  WriteFileAtomically(path_, text);
}

}  // namespace cairn
