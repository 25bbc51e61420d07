cimport cython

ctypedef unsigned char u8
ctypedef int i32
ctypedef long long i64

cdef u8 ON_NODES, ON_STRAIGHT_EDGES, ON_ALL_EDGES
cdef i64 UNSEEN, UNKNOWN, ANY_PLACE

cdef class IncomingArcs:
    cdef i64 rows
    cdef const i32[::1] first, sources
    cdef const double[::1] weights

cdef class MarkovChain:
    cdef i64 states, nodes
    cdef const i32[::1] first_on, states_on
    cdef const double[::1] shares, offsets
    cdef const i64[::1] ends
    cdef const u8[::1] are_bent

cdef class ChainBuffers:
    cdef double[::1] likelihoods, sums, missed

cdef class Evidence:
    cdef i64 targets
    cdef const i64[::1] first, rows, found, found_ends
    cdef const double[::1] missed, found_m
    cdef const u8[::1] kinds, shown

@cython.locals(target=i64, here=i64, there=i64, i=i64, k=i32, total=double)
cpdef int predict(IncomingArcs ways, double[::1] sums, const double[::1] values, i64 at, double[::1] out, i64 to, i64 targets, i64 steps) except -1 nogil
@cython.locals(target=i64, is_changed=bint)
cpdef int observe(MarkovChain c, Evidence e, ChainBuffers w, const double[::1] values, i64 at, double[::1] out, i64 to, i64 begin, i64 end, i64 finding, double[::1] totals) except -1 nogil
@cython.locals(found=i64, s=i64, look=i64, is_changed=bint)
cdef bint fill_likelihoods(MarkovChain c, Evidence e, ChainBuffers w, i64 target, i64 begin, i64 end, i64 finding) except -1 nogil
@cython.locals(kind=u8, k=i64, j=i32, s=i32, missed=double, is_changed=bint)
cdef bint take_look(MarkovChain c, Evidence e, ChainBuffers w, i64 look) except -1 nogil
@cython.locals(end=i64, node=i64, nearest=double, j=i32, s=i32, far=double)
cdef int mark_found(MarkovChain c, Evidence e, ChainBuffers w, i64 found) except -1 nogil
@cython.locals(s=i64, total=double, found=double)
cpdef double weigh(MarkovChain c, ChainBuffers w, bint is_changed, const double[::1] values, i64 at, double[::1] out, i64 to) except -1.0 nogil
@cython.locals(s=i64, total=double)
cdef double begin_again(MarkovChain c, ChainBuffers w, double[::1] out, i64 to) except -1.0 nogil
@cython.locals(number=i64, half=i64, i=i64)
cdef double sum_values(MarkovChain c, ChainBuffers w, const double[::1] values, i64 at) except -1.0 nogil
@cython.locals(node=i64, j=i32, total=double)
cpdef int add_to_nodes(MarkovChain c, const double[::1] values, i64 at, double[::1] out, i64 to) except -1 nogil
@cython.locals(best=i64, most=double, node=i64, gain=double)
cpdef i64 find_likeliest(const double[::1] chances, const double[::1] turns, i64 at, i64 nodes) except -2 nogil
@cython.locals(is_changed=bint, i=i64, k=i32, most=double, offer=double)
cpdef int spread(IncomingArcs ways, double[::1] labels, i64 at) except -1 nogil
