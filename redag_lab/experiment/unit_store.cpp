// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/unit_store.hpp"

#include <sqlite3.h>

#include <array>
#include <utility>

#include <fmt/format.h>

#include "redag/base/check.hpp"
#include "redag/trace/output_file.hpp"

namespace redag::experiment {
namespace {

using trace::file_error;

// The whole schema. A file with anything else in it, such as a view that never ends, is refused before it is read.
constexpr std::array<const char *, 2> kTables = {"CREATE TABLE origin(subject TEXT NOT NULL)",
                                                 "CREATE TABLE units(unit INTEGER PRIMARY KEY, result TEXT NOT NULL)"};
constexpr int kLongestText = 1 << 24;  // bytes of a result

tl::unexpected<Diagnostics> failure(const std::string &path, sqlite3 *database, std::string_view what) {
  const int code = database == nullptr ? SQLITE_NOMEM : sqlite3_errcode(database);
  if (code == SQLITE_BUSY || code == SQLITE_LOCKED) {
    return file_error(path, 0, "another process is writing to this folder",
                      "wait for that process, or choose another folder");
  }
  if (code == SQLITE_NOTADB || code == SQLITE_CORRUPT) {
    return file_error(path, 0, fmt::format("is damaged or no database: {}", sqlite3_errmsg(database)),
                      "choose another folder, or restore the file");
  }
  return file_error(path, 0, fmt::format("{}: {}", what, database == nullptr ? "no memory" : sqlite3_errmsg(database)));
}

std::string text_of(sqlite3_stmt *row, int column) {
  const auto *text = static_cast<const char *>(sqlite3_column_blob(row, column));
  return text == nullptr ? std::string()
                         : std::string(text, static_cast<std::size_t>(sqlite3_column_bytes(row, column)));
}

}  // namespace

void UnitCursor::Finalize::operator()(sqlite3_stmt *statement) const { sqlite3_finalize(statement); }

Result<bool> UnitCursor::next() {
  const int code = sqlite3_step(rows_.get());
  if (code == SQLITE_DONE) return false;
  if (code != SQLITE_ROW) return failure(path_, sqlite3_db_handle(rows_.get()), "cannot read");
  unit_.unit = static_cast<std::uint64_t>(sqlite3_column_int64(rows_.get(), 0));
  unit_.result = text_of(rows_.get(), 1);
  return true;
}

tl::unexpected<Diagnostics> two_results(const std::string &file, std::uint64_t unit, std::string_view first,
                                        std::string_view second) {
  return file_error(file, 0, fmt::format("unit {} has two results, '{}' and '{}'", unit, first, second),
                    "a unit depends on the plan alone: were they run by different builds of redag?");
}

void UnitStore::Close::operator()(sqlite3 *database) const { sqlite3_close(database); }

UnitStore::UnitStore(UnitStore &&other) noexcept = default;

UnitStore::~UnitStore() {
  if (database_ == nullptr) return;
  static_cast<void>(sync());
  insert_.reset();
  // One plain file remains, which can be read where nothing can be written.
  sqlite3_exec(database_.get(), "PRAGMA journal_mode=DELETE", nullptr, nullptr, nullptr);
}

Result<UnitStore> UnitStore::open(const std::string &path, std::string_view subject) {
  UnitStore store(path);
  Result<void> ready = store.connect(true);
  // Exclusive locking keeps no shared memory: write-ahead logs then work on network file systems, too.
  if (ready) ready = store.execute("PRAGMA journal_mode=WAL; PRAGMA synchronous=NORMAL", "cannot open");
  if (ready) ready = store.create(subject);
  if (ready) ready = store.check(subject);
  if (!ready) return tl::unexpected<Diagnostics>(std::move(ready.error()));
  Result<Statement> insert = store.prepare("INSERT INTO units VALUES(?1, ?2) ON CONFLICT DO NOTHING");
  if (!insert) return tl::unexpected<Diagnostics>(std::move(insert.error()));
  store.insert_ = std::move(*insert);
  return store;
}

Result<UnitStore> UnitStore::read(const std::string &path, std::string_view subject) {
  UnitStore store(path);
  Result<void> ready = store.connect(false);
  if (ready) ready = store.execute("PRAGMA cache_size=-256; PRAGMA journal_mode=DELETE", "cannot open");
  if (ready) ready = store.check(subject);
  if (!ready) return tl::unexpected<Diagnostics>(std::move(ready.error()));
  return store;
}

Result<void> UnitStore::connect(bool create) {
  sqlite3 *database = nullptr;
  const int flags = SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX | (create ? SQLITE_OPEN_CREATE : 0);
  const int code = sqlite3_open_v2(path_.c_str(), &database, flags, nullptr);
  database_.reset(database);
  if (code != SQLITE_OK) return failure(path_, database, "cannot open");
  sqlite3_limit(database, SQLITE_LIMIT_LENGTH, kLongestText);
  sqlite3_db_config(database, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  return execute("PRAGMA trusted_schema=OFF; PRAGMA cell_size_check=ON; PRAGMA locking_mode=EXCLUSIVE", "cannot open");
}

// Fills an empty file in one transaction: a kill leaves it empty or whole.
Result<void> UnitStore::create(std::string_view subject) {
  Result<Statement> any = prepare("SELECT 1 FROM sqlite_master");
  if (!any) return tl::unexpected<Diagnostics>(std::move(any.error()));
  const int code = sqlite3_step(any->get());
  if (code == SQLITE_ROW) return {};
  if (code != SQLITE_DONE) return failure(path_, database_.get(), "cannot read");
  any->reset();
  const std::string text = fmt::format("BEGIN;{};{}", kTables[0], kTables[1]);
  if (Result<void> made = execute(text.c_str(), "cannot write"); !made) return made;
  Result<Statement> origin = prepare("INSERT INTO origin VALUES(?1)");
  if (!origin) return tl::unexpected<Diagnostics>(std::move(origin.error()));
  sqlite3_bind_text(origin->get(), 1, subject.data(), static_cast<int>(subject.size()), SQLITE_STATIC);
  if (sqlite3_step(origin->get()) != SQLITE_DONE) return failure(path_, database_.get(), "cannot write");
  origin->reset();
  return execute("COMMIT", "cannot write");
}

Result<void> UnitStore::check(std::string_view subject) {
  Result<Statement> schema = prepare("SELECT sql FROM sqlite_master ORDER BY name");
  if (!schema) return tl::unexpected<Diagnostics>(std::move(schema.error()));
  std::size_t known = 0;
  int code = SQLITE_OK;
  while ((code = sqlite3_step(schema->get())) == SQLITE_ROW) {
    if (known == kTables.size() || text_of(schema->get(), 0) != kTables[known]) break;
    ++known;
  }
  if (code != SQLITE_ROW && code != SQLITE_DONE) return failure(path_, database_.get(), "cannot read");
  if (code == SQLITE_ROW || known != kTables.size()) {
    return file_error(path_, 0, "is a database, but not one of finished units", "choose another folder");
  }
  Result<Statement> origin = prepare("SELECT subject FROM origin");
  if (!origin) return tl::unexpected<Diagnostics>(std::move(origin.error()));
  code = sqlite3_step(origin->get());
  if (code != SQLITE_ROW && code != SQLITE_DONE) return failure(path_, database_.get(), "cannot read");
  if (code == SQLITE_ROW && text_of(origin->get(), 0) == subject) return {};
  return file_error(path_, 0, "holds results of another plan or of another version of redag",
                    fmt::format("expected '{}'; choose another folder", subject));
}

Result<void> UnitStore::execute(const char *statement, const char *what) {
  if (sqlite3_exec(database_.get(), statement, nullptr, nullptr, nullptr) == SQLITE_OK) return {};
  return failure(path_, database_.get(), what);
}

Result<UnitStore::Statement> UnitStore::prepare(const char *text) const {
  sqlite3_stmt *statement = nullptr;
  const int code = sqlite3_prepare_v2(database_.get(), text, -1, &statement, nullptr);
  Statement owned(statement);
  if (code == SQLITE_OK) return owned;
  return failure(path_, database_.get(), "cannot read");
}

Result<UnitCursor> UnitStore::units() const {
  Result<Statement> rows = prepare("SELECT unit, result FROM units ORDER BY unit");
  if (!rows) return tl::unexpected<Diagnostics>(std::move(rows.error()));
  UnitCursor cursor;
  cursor.path_ = path_;
  cursor.rows_ = std::move(*rows);
  return cursor;
}

// The unit is there already: its result must be this one.
Result<void> UnitStore::compare(std::uint64_t unit, const std::string &result) {
  Result<Statement> there = prepare("SELECT result FROM units WHERE unit = ?1");
  if (!there) return tl::unexpected<Diagnostics>(std::move(there.error()));
  sqlite3_bind_int64(there->get(), 1, static_cast<sqlite3_int64>(unit));
  if (sqlite3_step(there->get()) != SQLITE_ROW) return failure(path_, database_.get(), "cannot read");
  const std::string first = text_of(there->get(), 0);
  if (first == result) return {};
  return two_results(path_, unit, first, result);
}

Result<void> UnitStore::append(std::uint64_t unit, const std::string &result) {
  REDAG_CHECK(result.find('\n') == std::string::npos, "a result is one line");
  if (broken_) return {};
  if (!open_transaction_) {
    if (Result<void> begun = execute("BEGIN", "cannot write"); !begun) return begun;
    open_transaction_ = true;
  }
  sqlite3_bind_int64(insert_.get(), 1, static_cast<sqlite3_int64>(unit));
  sqlite3_bind_text(insert_.get(), 2, result.data(), static_cast<int>(result.size()), SQLITE_STATIC);
  const bool written = sqlite3_step(insert_.get()) == SQLITE_DONE;
  const bool added = written && sqlite3_changes(database_.get()) == 1;
  Result<void> done;
  if (!written) done = failure(path_, database_.get(), "cannot write");
  sqlite3_reset(insert_.get());
  sqlite3_clear_bindings(insert_.get());
  if (written && !added) done = compare(unit, result);
  if (!done) {
    broken_ = !written;
    return done;
  }
  const Clock::time_point now = Clock::now();
  if (now - last_sync_ >= kSyncEvery) return sync();
  if (now - last_write_ >= kWriteEvery) return commit();
  return {};
}

Result<void> UnitStore::commit() {
  last_write_ = Clock::now();
  if (broken_ || !open_transaction_) return {};
  open_transaction_ = false;
  Result<void> done = execute("COMMIT", "cannot write");
  broken_ = !done;
  return done;
}

Result<void> UnitStore::sync() {
  if (Result<void> written = commit(); !written) return written;
  last_sync_ = Clock::now();
  if (broken_ || insert_ == nullptr) return {};
  return execute("PRAGMA wal_checkpoint(PASSIVE)", "cannot write to disk");
}

}  // namespace redag::experiment
