// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Annotations for clang's -Wthread-safety: which mutex guards a member, and which one a function needs. Empty for other
// compilers. tools/check_sources (make lint) checks them.
// https://clang.llvm.org/docs/ThreadSafetyAnalysis.html
#pragma once

#if defined(__clang__)
#define REDAG_THREAD_ANNOTATION(x) __attribute__((x))
#else
#define REDAG_THREAD_ANNOTATION(x)
#endif

// For a class: it is a mutex, or it holds one for its lifetime.
#define REDAG_CAPABILITY(name) REDAG_THREAD_ANNOTATION(capability(name))
#define REDAG_SCOPED_CAPABILITY REDAG_THREAD_ANNOTATION(scoped_lockable)
// For a member: it, or what it points to, is used only under that mutex.
#define REDAG_GUARDED_BY(mutex) REDAG_THREAD_ANNOTATION(guarded_by(mutex))
#define REDAG_PT_GUARDED_BY(mutex) REDAG_THREAD_ANNOTATION(pt_guarded_by(mutex))
// For a function: its caller holds the mutex, or must not hold it; the function takes it, or releases it.
#define REDAG_REQUIRES(...) REDAG_THREAD_ANNOTATION(requires_capability(__VA_ARGS__))
#define REDAG_EXCLUDES(...) REDAG_THREAD_ANNOTATION(locks_excluded(__VA_ARGS__))
#define REDAG_ACQUIRE(...) REDAG_THREAD_ANNOTATION(acquire_capability(__VA_ARGS__))
#define REDAG_TRY_ACQUIRE(...) REDAG_THREAD_ANNOTATION(try_acquire_capability(__VA_ARGS__))
#define REDAG_RELEASE(...) REDAG_THREAD_ANNOTATION(release_capability(__VA_ARGS__))
// Tells the analysis that the mutex is held where the analysis cannot see it. A comment there says why.
#define REDAG_ASSERT_CAPABILITY(mutex) REDAG_THREAD_ANNOTATION(assert_capability(mutex))
#define REDAG_RETURN_CAPABILITY(mutex) REDAG_THREAD_ANNOTATION(lock_returned(mutex))
#define REDAG_NO_THREAD_SAFETY_ANALYSIS REDAG_THREAD_ANNOTATION(no_thread_safety_analysis)
