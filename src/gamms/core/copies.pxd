cimport cython

cdef extern from "Python.h":
    cpdef dict as_dict "Py_NewRef" (object value)

cpdef copied(object value, object memo=*)
cpdef copied_values(object each, object memo=*)
cpdef copied_dict(object value, object memo=*)
@cython.locals(made=dict)
cpdef copied_each(object dicts, object memo=*)
@cython.locals(made=dict)
cpdef copied_filled(object each, object memo=*)
@cython.locals(one=tuple)
cpdef list copied_fields(list values, list copies, object memo=*)
@cython.locals(one=tuple)
cpdef int restore_fields(object state, list values, list shared, list replaced, list refilled) except -1
cpdef refill(object known, object value)
cpdef refill_each(object known, object value)
cpdef refill_counts(object known, object value)
cdef _add_missing(object known, object value)
cdef _copy_or_share(object value, object memo)
@cython.locals(known=dict, made=dict, own=object)
cdef object _copy_of(object value, set seen)
